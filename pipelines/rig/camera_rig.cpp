#include "pipelines/rig/camera_rig.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "core/camera_places.h"
#include "core/check.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/text.h"

namespace hsi4d {

namespace {

constexpr double kFocal = 0.8;                         // of the picture's width
constexpr double kLowestEye = 0.6, kHighestEye = 1.9;  // metres over the floor
constexpr int kProbes = 64;                            // rays around a place
constexpr int kProbeSize = 24;                         // pixels of a view that is judged
constexpr double kMostNear = 0.02;                     // share of a view that may be near
constexpr double kNearMiddle = 2;                      // of `nearest`: half of a view is farther away than that
constexpr Index kSpare = 3;                            // good views for each that is taken
constexpr Index kTries = 30;                           // places for each good view that is wanted

std::array<Vector3<double>, 2> bounds_of(const TexturedMesh& mesh, const RigSettings& settings) {
  if (!settings.box) return {mesh.low, mesh.high};
  const Vector3<double> a(settings.box->data()), b(settings.box->data() + 3);
  return {a.cwiseMin(b), a.cwiseMax(b)};
}

std::vector<Vector3<double>> directions() {
  const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
  std::vector<Vector3<double>> all;
  for (int k = 0; k < kProbes; ++k) {
    const double z = 1 - 2 * (k + 0.5) / kProbes, across = std::sqrt(1 - z * z);
    all.emplace_back(across * std::cos(golden * k), across * std::sin(golden * k), z);
  }
  return all;
}

/// What becomes of a try.
enum class Fate { kGood, kNoRoom, kNear, kBacks, kLittle };

/// A place on a surface, coarsely, and to which side it faces.
using Cell = std::array<std::int64_t, 4>;

struct Outlook {
  Fate fate = Fate::kNoRoom;
  Camera camera;
  std::vector<Cell> cells;  ///< what it shows
};

/// Judges places and views.
class Seeker {
 public:
  Seeker(const CastMesh& mesh, const RigSettings& settings, std::uint64_t seed)
      : mesh_(mesh),
        settings_(settings),
        bounds_(bounds_of(mesh.mesh(), settings)),
        random_(seed, random_stream("rig.places")),
        cell_(std::max(0.05, (bounds_[1] - bounds_[0]).maxCoeff() / 64)) {}

  /// Try number `k`.
  Outlook view(Index k) const {
    const auto at = static_cast<std::uint64_t>(8 * k);
    Outlook view;
    Vector3<double> eye;
    if (!find_eye(at, eye)) return view;
    const std::vector<MeshHit> around = mesh_.cast(rays_from(eye));
    if (!has_room(around)) return view;
    view.camera = camera_at(eye, eye + direction_of(k, at, around), kFocal, settings_.size);
    judge(view);
    return view;
  }

 private:
  /// A place at the height of hands or eyes over the floor under a random place.
  bool find_eye(std::uint64_t at, Vector3<double>& eye) const {
    const Vector3<double> size = bounds_[1] - bounds_[0];
    for (Index i = 0; i < 3; ++i)
      eye[i] = bounds_[0][i] + size[i] * random_.uniform(at + static_cast<std::uint64_t>(i));
    const WorldRay down{eye, Vector3<double>(0, 0, -1)};
    const MeshHit under = mesh_.cast({&down, 1}).front();
    if (under.face < 0) return false;
    eye[2] += random_.uniform(at + 3, kLowestEye, kHighestEye) - under.distance;
    return eye[2] < bounds_[1][2];
  }

  std::vector<WorldRay> rays_from(const Vector3<double>& eye) const {
    std::vector<WorldRay> rays;
    for (const Vector3<double>& direction : directions_) rays.push_back({eye, direction});
    return rays;
  }

  bool has_room(const std::vector<MeshHit>& around) const {
    Index backs = 0;
    for (const MeshHit& hit : around) {
      if (hit.face < 0) continue;
      if (hit.distance < settings_.nearest) return false;
      if (hit.cosine > 0) ++backs;
    }
    return static_cast<double>(backs) <= std::max(1.0, settings_.most_backs * kProbes);
  }

  /// Half look where it is wide and about level, the others to any side.
  Vector3<double> direction_of(Index k, std::uint64_t at, const std::vector<MeshHit>& around) const {
    const double turn = random_.uniform(at + 4, 0, 2 * std::numbers::pi);
    constexpr double kSteepest = 0.85;  // sine of the angle
    const double rise = random_.uniform(at + 5, -kSteepest, kSteepest), across = std::sqrt(1 - rise * rise);
    const Vector3<double> any(across * std::cos(turn), across * std::sin(turn), rise);
    return k % 2 == 0 ? any : widest(random_.uniform(at + 6), around, any);
  }

  /// A direction that is drawn by how far one sees in it.
  Vector3<double> widest(double share, const std::vector<MeshHit>& around, const Vector3<double>& otherwise) const {
    constexpr double kLevel = 0.5;  // sine of the angle
    std::vector<double> sums;
    double sum = 0;
    for (std::size_t i = 0; i < around.size(); ++i) {
      const bool counts = around[i].face >= 0 && std::fabs(directions_[i][2]) < kLevel;
      sum += counts ? around[i].distance : 0;
      sums.push_back(sum);
    }
    const auto found = std::upper_bound(sums.begin(), sums.end(), share * sum);
    return found == sums.end() ? otherwise : directions_[static_cast<std::size_t>(found - sums.begin())];
  }

  void judge(Outlook& view) const {
    const PictureRays small(resized(view.camera, kProbeSize, kProbeSize));
    std::vector<WorldRay> rays;
    for (int i = 0; i < kProbeSize * kProbeSize; ++i)
      rays.push_back(small.through(i % kProbeSize + 0.5, i / kProbeSize + 0.5));
    const std::vector<MeshHit> hits = mesh_.cast(rays);
    Index near = 0, near_middle = 0, backs = 0, seen = 0;
    for (std::size_t i = 0; i < hits.size(); ++i) {
      if (hits[i].face < 0) continue;
      ++seen;
      near += hits[i].distance < settings_.nearest ? 1 : 0;
      near_middle += hits[i].distance < kNearMiddle * settings_.nearest ? 1 : 0;
      backs += hits[i].cosine > 0 ? 1 : 0;
      view.cells.push_back(cell_of(hits[i], rays[i]));
    }
    const auto share = [&](Index count) { return static_cast<double>(count) / static_cast<double>(hits.size()); };
    view.fate = share(seen) < settings_.least_seen                    ? Fate::kLittle
                : share(near) > kMostNear || share(near_middle) > 0.5 ? Fate::kNear
                : share(backs) > settings_.most_backs                 ? Fate::kBacks
                                                                      : Fate::kGood;
    std::sort(view.cells.begin(), view.cells.end());
    view.cells.erase(std::unique(view.cells.begin(), view.cells.end()), view.cells.end());
  }

  Cell cell_of(const MeshHit& hit, const WorldRay& ray) const {
    const TexturedMesh& mesh = mesh_.mesh();
    const Vector3<double> a = corner_of(mesh, hit.face, 0);
    const Vector3<double> normal =
        cross(Vector3<double>(corner_of(mesh, hit.face, 1) - a), Vector3<double>(corner_of(mesh, hit.face, 2) - a));
    const Vector3<double> place = ray.origin + hit.distance * ray.direction;
    Index axis = 0;
    normal.cwiseAbs().maxCoeff(&axis);
    Cell cell{2 * axis + (normal[axis] > 0 ? 1 : 0)};
    for (std::size_t i = 0; i < 3; ++i)
      cell[i + 1] = static_cast<std::int64_t>(std::floor(place[static_cast<Index>(i)] / cell_));
    return cell;
  }

  const CastMesh& mesh_;
  const RigSettings& settings_;
  std::array<Vector3<double>, 2> bounds_;
  Random random_;
  double cell_;
  std::vector<Vector3<double>> directions_ = directions();
};

void count_fate(Fate fate, Rig& rig) {
  ++rig.tried;
  if (fate == Fate::kNoRoom) ++rig.no_room;
  if (fate == Fate::kNear) ++rig.near;
  if (fate == Fate::kBacks) ++rig.backs;
  if (fate == Fate::kLittle) ++rig.little;
}

/// Good views in the order of tries, until there are enough.
std::vector<Outlook> good_views(const Seeker& seeker, Index wanted, Rig& rig) {
  constexpr Index kAtOnce = 256;
  std::vector<Outlook> good;
  while (std::ssize(good) < wanted && rig.tried < kTries * wanted) {
    std::vector<Outlook> views(kAtOnce);
    const Index first = rig.tried;
    parallel_for(kAtOnce, 4, [&](Index begin, Index end) {
      for (Index k = begin; k < end; ++k) views[static_cast<std::size_t>(k)] = seeker.view(first + k);
    });
    for (Outlook& view : views) {
      count_fate(view.fate, rig);
      if (view.fate == Fate::kGood && std::ssize(good) < wanted) good.push_back(std::move(view));
    }
  }
  return good;
}

/// Cells of views by numbers.
std::vector<std::vector<std::size_t>> numbered_cells(const std::vector<Outlook>& views, std::size_t& count) {
  std::map<Cell, std::size_t> numbers;
  std::vector<std::vector<std::size_t>> all;
  for (const Outlook& view : views) {
    all.emplace_back();
    for (const Cell& cell : view.cells) all.back().push_back(numbers.emplace(cell, numbers.size()).first->second);
  }
  count = numbers.size();
  return all;
}

/// Takes `count` views, one after the other, each the one whose cells were seen least: Σ 1/(1 + times seen).
std::vector<std::size_t> chosen_views(const std::vector<Outlook>& views, Index count, Rig& rig) {
  std::size_t cells = 0;
  const std::vector<std::vector<std::size_t>> shown = numbered_cells(views, cells);
  std::vector<int> times(cells, 0);
  std::vector<char> is_taken(views.size(), 0);
  std::vector<std::size_t> taken;
  while (std::ssize(taken) < std::min<Index>(count, std::ssize(views))) {
    std::size_t best = 0;
    double most = -1;
    for (std::size_t i = 0; i < views.size(); ++i) {
      if (is_taken[i] != 0) continue;
      double gain = 0;
      for (const std::size_t cell : shown[i]) gain += 1.0 / (1 + times[cell]);
      if (gain > most) best = i;
      most = std::max(most, gain);
    }
    is_taken[best] = 1;
    taken.push_back(best);
    for (const std::size_t cell : shown[best]) ++times[cell];
  }
  const auto unseen = std::count(times.begin(), times.end(), 0);
  rig.seen = cells == 0 ? 0 : 1 - static_cast<double>(unseen) / static_cast<double>(cells);
  std::sort(taken.begin(), taken.end());  // in the order of tries: what is held back is like the others
  return taken;
}

}  // namespace

Rig rig_around(const TexturedMesh& mesh, const RigSettings& settings) {
  double radius = 0;
  for (std::int32_t f = 0; f < std::ssize(mesh.faces); ++f) {
    for (std::size_t k = 0; k < 3; ++k) radius = std::max(radius, corner_of(mesh, f, k).norm());
  }
  Rig rig;
  const Index count = settings.count > 0 ? settings.count : kPicturesOfObject;
  rig.cameras = cameras_around(mesh.origin, radius, count, settings.size, kAllSides);
  rig.tried = count;
  rig.seen = 1;
  return rig;
}

Rig rig_inside(const CastMesh& mesh, const RigSettings& settings, std::uint64_t seed, const std::string& name) {
  Rig rig;
  const Index count = settings.count > 0 ? settings.count : kPicturesOfScene;
  const std::vector<Outlook> good = good_views(Seeker(mesh, settings, seed), kSpare * count, rig);
  const std::vector<std::size_t> taken = chosen_views(good, count, rig);
  for (const std::size_t i : taken) rig.cameras.push_back(good[i].camera);
  rig.spare = std::ssize(good) - std::ssize(taken);
  if (rig.cameras.empty())
    throw UserError(name + ": no camera in it sees enough; " + rig_text(rig) +
                    ". Is it a scene in metres, z up, its faces' fronts inside? /photos/rig/box says where cameras may "
                    "be; \"kind\": \"object\" looks from outside");
  return rig;
}

std::string rig_text(const Rig& rig) {
  return "of " + std::to_string(rig.tried) + " places " + std::to_string(rig.cameras.size()) +
         " views; left out: " + std::to_string(rig.no_room) + " without a floor or too near to something, " +
         std::to_string(rig.near) + " that look at something near, " + std::to_string(rig.backs) +
         " at backs of faces, " + std::to_string(rig.little) + " that show little, " + std::to_string(rig.spare) +
         " that show what others show";
}

}  // namespace hsi4d
