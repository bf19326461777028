#include "body/surface_sampling.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/parallel.h"
#include "core/random.h"

namespace hsi4d {

namespace {

using Vector = Vector3<double>;

constexpr Index kCandidates = 12;  ///< for each place that is wanted
constexpr int kMoves = 6;
constexpr Index kGrain = 1 << 14;

struct Candidate {
  std::int32_t face;
  std::array<float, 3> point;

  Vector position() const {
    return {static_cast<double>(point[0]), static_cast<double>(point[1]), static_cast<double>(point[2])};
  }
};

/// A body's surface, prepared for drawing places on it.
struct Surface {
  const BodyModel& body;
  std::span<const double> density;  // [V]
  std::vector<Vector> normals;      // [F] of length 1; 0 of a face without area
  std::vector<double> cumulative;   // [F], area times density

  Surface(const BodyModel& model, std::span<const double> densities) : body(model), density(densities) {
    double sum = 0;
    for (std::int32_t face = 0; face < body.face_count(); ++face) {
      const std::array<Vector, 3> c = face_corners(body, face);
      const Direction<double, 3> area = direction_of(cross(Vector(c[1] - c[0]), Vector(c[2] - c[0])));
      normals.push_back(area.unit);
      sum += 0.5 * area.length * density_at(face, {1.0 / 3, 1.0 / 3, 1.0 / 3});
      cumulative.push_back(sum);
    }
    HSI4D_CHECK(sum > 0, "the body's surface has no area");
  }

  double density_at(std::int32_t face, const std::array<double, 3>& shares) const {
    double result = 0;
    for (std::size_t i = 0; i < 3; ++i)
      result += shares[i] * density[static_cast<std::size_t>(body.faces[3 * static_cast<std::size_t>(face) + i])];
    return result;
  }
  const Vector& normal(std::int32_t face) const { return normals[static_cast<std::size_t>(face)]; }
};

/// Places in strata of equal share, evenly within each triangle.
std::vector<Candidate> draw_candidates(const Surface& surface, Index count, std::uint64_t seed) {
  const Random along(seed, random_stream("avatar.triangle")), in_a(seed, random_stream("avatar.u")),
      in_b(seed, random_stream("avatar.v"));
  const double total = surface.cumulative.back();
  std::vector<Candidate> candidates(static_cast<std::size_t>(count));
  parallel_for(count, kGrain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const auto at = static_cast<std::uint64_t>(i);
      const double target = (static_cast<double>(i) + along.uniform(at)) / static_cast<double>(count) * total;
      const auto found = std::upper_bound(surface.cumulative.begin(), surface.cumulative.end() - 1, target);
      const auto face = static_cast<std::int32_t>(found - surface.cumulative.begin());
      double u = in_a.uniform(at), v = in_b.uniform(at);
      if (u + v > 1) u = 1 - u, v = 1 - v;
      const std::array<Vector, 3> c = face_corners(surface.body, face);
      const Vector point = c[0] * (1 - u - v) + c[1] * u + c[2] * v;
      candidates[static_cast<std::size_t>(i)] = {
          face, {static_cast<float>(point[0]), static_cast<float>(point[1]), static_cast<float>(point[2])}};
    }
  });
  return candidates;
}

/// A place that is kept, on its way.
struct Kept {
  Vector point;
  std::int32_t face;
  double spacing;  // that is wanted
};

/// Kept places, found by where they are: a hash table of cells.
class Grid {
 public:
  Grid(const Surface& surface, double cell, Index wanted) : surface_(surface), cell_(cell) {
    std::size_t size = 64;
    while (size < static_cast<std::size_t>(2 * wanted)) size *= 2;
    heads_.assign(size, -1);
    next_.reserve(static_cast<std::size_t>(wanted));
    kept_.reserve(static_cast<std::size_t>(wanted));
  }

  void add(const Kept& place) {
    std::int32_t& head = heads_[slot(cell_of(place.point))];
    next_.push_back(head);
    head = static_cast<std::int32_t>(kept_.size());
    kept_.push_back(place);
  }
  Index count() const { return static_cast<Index>(kept_.size()); }

  /// Calls found(i, squared distance) for the kept places on the same side in the cells around.
  template <class F>
  void around(const Vector& point, std::int32_t face, F&& found) const {
    const std::array<std::int64_t, 3> at = cell_of(point);
    const Vector& normal = surface_.normal(face);
    for (int k = 0; k < 27; ++k) {
      const std::array<std::int64_t, 3> cell = {at[0] + k / 9 - 1, at[1] + k / 3 % 3 - 1, at[2] + k % 3 - 1};
      for (std::int32_t o = heads_[slot(cell)]; o >= 0; o = next_[static_cast<std::size_t>(o)]) {
        const Kept& other = kept_[static_cast<std::size_t>(o)];
        if (cell_of(other.point) != cell) continue;  // another cell of the same slot
        const Vector off = other.point - point;
        if (dot(surface_.normal(other.face), normal) > 0) found(o, dot(off, off));
      }
    }
  }

 private:
  std::array<std::int64_t, 3> cell_of(const Vector& p) const {
    return {static_cast<std::int64_t>(std::floor(p[0] / cell_)), static_cast<std::int64_t>(std::floor(p[1] / cell_)),
            static_cast<std::int64_t>(std::floor(p[2] / cell_))};
  }
  std::size_t slot(const std::array<std::int64_t, 3>& c) const {
    const std::uint64_t h = static_cast<std::uint64_t>(c[0]) * 0x9E3779B97F4A7C15u ^
                            static_cast<std::uint64_t>(c[1]) * 0xC2B2AE3D27D4EB4Fu ^
                            static_cast<std::uint64_t>(c[2]) * 0x165667B19E3779F9u;
    return static_cast<std::size_t>(h >> 17) & (heads_.size() - 1);
  }

  const Surface& surface_;
  double cell_;
  std::vector<std::int32_t> heads_, next_;
  std::vector<Kept> kept_;
};

/// The work, step by step.
class Sampling {
 public:
  Sampling(const Surface& surface, Index count, std::uint64_t seed)
      : surface_(surface),
        wanted_(count),
        seed_(seed),
        candidates_(draw_candidates(surface, count * kCandidates, seed)),
        owners_(candidates_.size(), -1) {
    const double total = surface.cumulative.back();
    unit_spacing_ = std::sqrt(total / static_cast<double>(count));
    double least = std::numeric_limits<double>::infinity();
    for (const double density : surface.density) least = std::min(least, density);
    largest_spacing_ = unit_spacing_ / std::sqrt(least);
  }

  std::vector<SurfaceSample> result() {
    throw_darts();
    for (int i = 0; i < kMoves; ++i) {
      find_owners();
      move_to_middles();
    }
    find_owners();
    return measured();
  }

 private:
  double spacing_at(const Vector& point, std::int32_t face) const {
    const SurfacePlace place = nearest_on_triangle(face_corners(surface_.body, face), point);
    return unit_spacing_ / std::sqrt(surface_.density_at(face, place.shares));
  }

  /// As many candidates as are wanted, in random order, first with the distance of a dense packing, then with ever
  /// smaller ones until there are enough.
  void throw_darts() {
    std::vector<Index> order =
        Random(seed_, random_stream("avatar.order")).permutation(0, static_cast<Index>(candidates_.size()));
    Grid grid(surface_, largest_spacing_, wanted_);
    for (double share = 0.8; grid.count() < wanted_; share = share < 1e-3 ? 0 : share * 0.93) {
      std::vector<Index> left;
      for (const Index i : order) {
        if (grid.count() == wanted_) break;
        const Candidate& c = candidates_[static_cast<std::size_t>(i)];
        const Kept place = {c.position(), c.face, spacing_at(c.position(), c.face)};
        bool crowded = false;
        grid.around(place.point, place.face, [&](std::int32_t o, double squared) {
          const double nearest = share * std::min(place.spacing, kept_[static_cast<std::size_t>(o)].spacing);
          crowded = crowded || squared < nearest * nearest;
        });
        if (crowded) {
          left.push_back(i);
          continue;
        }
        grid.add(place);
        kept_.push_back(place);
      }
      order = std::move(left);
    }
  }

  /// The kept place that is nearest to each candidate, on its side.
  void find_owners() {
    Grid grid(surface_, largest_spacing_, wanted_);
    for (const Kept& place : kept_) grid.add(place);
    parallel_for(static_cast<Index>(candidates_.size()), kGrain, [&](Index begin, Index end) {
      for (Index i = begin; i < end; ++i) {
        const Candidate& c = candidates_[static_cast<std::size_t>(i)];
        double nearest = std::numeric_limits<double>::infinity();
        std::int32_t owner = -1;
        grid.around(c.position(), c.face, [&](std::int32_t o, double squared) {
          if (squared < nearest || (squared == nearest && o < owner)) nearest = squared, owner = o;
        });
        owners_[static_cast<std::size_t>(i)] = owner;
      }
    });
  }

  /// Each place goes to the mean of its candidates, back onto the face of the one that is nearest there. Weighted by
  /// the density, beside that of the candidates themselves, places keep it.
  void move_to_middles() {
    std::vector<Vector4<double>> sums(kept_.size(), Vector4<double>::Zero());
    for (std::size_t i = 0; i < candidates_.size(); ++i) {
      if (owners_[i] < 0) continue;
      const Vector point = candidates_[i].position();
      const double spacing = spacing_at(point, candidates_[i].face);
      const double weight = 1 / (spacing * spacing);
      sums[static_cast<std::size_t>(owners_[i])] +=
          Vector4<double>(weight * point[0], weight * point[1], weight * point[2], weight);
    }
    std::vector<std::pair<double, std::int32_t>> nearest(kept_.size(), {std::numeric_limits<double>::infinity(), -1});
    for (std::size_t i = 0; i < candidates_.size(); ++i) {
      if (owners_[i] < 0) continue;
      const auto owner = static_cast<std::size_t>(owners_[i]);
      const Vector off = candidates_[i].position() - Vector(sums[owner].head<3>() / sums[owner][3]);
      const double squared = dot(off, off);
      if (squared < nearest[owner].first) nearest[owner] = {squared, candidates_[i].face};
    }
    for (std::size_t k = 0; k < kept_.size(); ++k) {
      if (nearest[k].second < 0) continue;
      const std::int32_t face = nearest[k].second;
      const Vector middle = sums[k].head<3>() / sums[k][3];
      kept_[k].point = nearest_on_triangle(face_corners(surface_.body, face), middle).point;
      kept_[k].face = face;
      kept_[k].spacing = spacing_at(kept_[k].point, face);
    }
  }

  std::vector<SurfaceSample> measured() const {
    std::vector<SurfaceSample> samples(kept_.size());
    for (std::size_t k = 0; k < kept_.size(); ++k) {
      samples[k].place = nearest_on_triangle(face_corners(surface_.body, kept_[k].face), kept_[k].point);
      samples[k].place.face = kept_[k].face;
      samples[k].wanted_spacing = kept_[k].spacing;
    }
    for (std::size_t i = 0; i < candidates_.size(); ++i) {
      if (owners_[i] < 0) continue;
      SurfaceSample& sample = samples[static_cast<std::size_t>(owners_[i])];
      const Vector point = candidates_[i].position(), off = point - sample.place.point;
      const double wanted = spacing_at(point, candidates_[i].face);
      sample.spacing += wanted * wanted / static_cast<double>(kCandidates);  // its share of the area
      sample.reach = std::max(sample.reach, std::sqrt(dot(off, off)));
    }
    for (SurfaceSample& sample : samples) sample.spacing = std::sqrt(sample.spacing);
    std::stable_sort(samples.begin(), samples.end(),
                     [](const SurfaceSample& a, const SurfaceSample& b) { return a.place.face < b.place.face; });
    return samples;
  }

  const Surface& surface_;
  Index wanted_;
  std::uint64_t seed_;
  std::vector<Candidate> candidates_;
  std::vector<std::int32_t> owners_;  // by candidate
  std::vector<Kept> kept_;
  double unit_spacing_ = 0;  // metres, where the density is 1
  double largest_spacing_ = 0;
};

}  // namespace

std::vector<SurfaceSample> sample_surface(const BodyModel& body, std::span<const double> density, Index count,
                                          std::uint64_t seed) {
  HSI4D_CHECK(body.face_count() > 0, "the body has no surface");
  HSI4D_CHECK_EQ(static_cast<Index>(density.size()), body.vertex_count());
  HSI4D_CHECK(count >= 0, "a negative count of places");
  for (const double value : density) HSI4D_CHECK(value > 0 && std::isfinite(value), "a density is not above 0");
  if (count == 0) return {};
  const Surface surface(body, density);
  return Sampling(surface, count, seed).result();
}

}  // namespace hsi4d
