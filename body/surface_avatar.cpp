// Gaussians on a surface: many random places, of which as many as wanted are kept, far apart from each other.
#include <algorithm>
#include <cmath>
#include <sstream>

#include "body/avatar.h"
#include "body/clothing.h"
#include "core/quaternion.h"
#include "core/random.h"

namespace hsi4d {

namespace {

using Vector = Vector3<double>;

/// Random places for each Gaussian that is wanted.
constexpr Index kCandidates = 6;

struct Candidate {
  Vector point, normal;
  std::array<std::int32_t, 3> vertices;
  std::array<double, 3> shares;  // barycentric
  double spacing;                // wanted mean distance of neighbours here, metres
};

void require_range(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return;
  std::ostringstream text;
  text << "avatar: " << name << " is " << value << "; allowed: " << low << " to " << high;
  throw UserError(text.str());
}

/// Gaussians per area over those of the trunk: parts with detail need more.
double density_of(std::int32_t joint) {
  if (joint >= 25) return 6;                                               // fingers
  if (joint == 20 || joint == 21) return 4;                                // wrists
  if (joint == 15 || (joint >= 22 && joint <= 24)) return 2.5;             // head
  if (joint == 12 || joint == 18 || joint == 19) return 1.5;               // neck, forearms
  if (joint == 7 || joint == 8 || joint == 10 || joint == 11) return 1.5;  // feet
  return 1;
}

/// A body's surface, prepared for drawing places on it.
struct Surface {
  const BodyModel& body;
  std::vector<Vector> normals;     // [V] of length 1
  std::vector<double> densities;   // [V]
  std::vector<double> cumulative;  // [F], area times density

  Vector vertex(std::int32_t v) const {
    const float* x = body.vertices.data() + 3 * v;
    return {static_cast<double>(x[0]), static_cast<double>(x[1]), static_cast<double>(x[2])};
  }

  explicit Surface(const BodyModel& model) : body(model), normals(static_cast<std::size_t>(model.vertex_count())) {
    for (Index v = 0; v < body.vertex_count(); ++v) {
      normals[static_cast<std::size_t>(v)] = Vector::Zero();
      double density = 0;
      for (Index k = v * body.weights.per_vertex; k < (v + 1) * body.weights.per_vertex; ++k) {
        const auto i = static_cast<std::size_t>(k);
        density += body.weights.weights[i] * density_of(body.weights.indices[i]);
      }
      densities.push_back(density);
    }
    double sum = 0;
    for (std::size_t f = 0; f < body.faces.size(); f += 3) {
      const std::int32_t* corner = body.faces.data() + f;
      const Vector a = vertex(corner[0]);
      const Vector area = cross(Vector(vertex(corner[1]) - a), Vector(vertex(corner[2]) - a)) * 0.5;
      double density = 0;
      for (int i = 0; i < 3; ++i) {
        normals[static_cast<std::size_t>(corner[i])] += area;
        density += densities[static_cast<std::size_t>(corner[i])] / 3;
      }
      sum += std::sqrt(dot(area, area)) * density;
      cumulative.push_back(sum);
    }
    for (Vector& normal : normals) normal = direction_of(normal).unit;
  }
};

/// Places in strata of equal share, evenly within each triangle.
std::vector<Candidate> draw_candidates(const Surface& surface, Index wanted, std::uint64_t seed) {
  const Random along(seed, random_stream("avatar.triangle")), in_a(seed, random_stream("avatar.u")),
      in_b(seed, random_stream("avatar.v"));
  const double total = surface.cumulative.back(), spacing = std::sqrt(total / static_cast<double>(wanted));
  const Index count = wanted * kCandidates;
  std::vector<Candidate> candidates(static_cast<std::size_t>(count));
  std::size_t face = 0;
  for (Index i = 0; i < count; ++i) {
    const auto at = static_cast<std::uint64_t>(i);
    const double target = (static_cast<double>(i) + along.uniform(at)) / static_cast<double>(count) * total;
    while (face + 1 < surface.cumulative.size() && surface.cumulative[face] <= target) ++face;
    double u = in_a.uniform(at), v = in_b.uniform(at);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    Candidate& c = candidates[static_cast<std::size_t>(i)];
    c.shares = {1 - u - v, u, v};
    c.point = c.normal = Vector::Zero();
    double density = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      c.vertices[k] = surface.body.faces[3 * face + k];
      c.point += surface.vertex(c.vertices[k]) * c.shares[k];
      c.normal += surface.normals[static_cast<std::size_t>(c.vertices[k])] * c.shares[k];
      density += surface.densities[static_cast<std::size_t>(c.vertices[k])] * c.shares[k];
    }
    c.normal = direction_of(c.normal).unit;
    c.spacing = spacing / std::sqrt(density);
  }
  return candidates;
}

/// Kept places, found by where they are: a hash table of cells.
class KeptPlaces {
 public:
  KeptPlaces(const std::vector<Candidate>& candidates, double cell, Index wanted)
      : candidates_(candidates), cell_(cell), next_(candidates.size(), -1) {
    std::size_t size = 64;
    while (size < static_cast<std::size_t>(2 * wanted)) size *= 2;
    heads_.assign(size, -1);
  }
  void add(std::int32_t i) {
    std::int32_t& head = heads_[slot(cell_of(candidates_[static_cast<std::size_t>(i)].point))];
    next_[static_cast<std::size_t>(i)] = head;
    head = i;
  }
  /// Whether a kept place on the same side of the surface is nearer than `share` of the smaller spacing.
  bool crowded(std::int32_t i, double share) const {
    const Candidate& c = candidates_[static_cast<std::size_t>(i)];
    const std::array<std::int64_t, 3> at = cell_of(c.point);
    for (int k = 0; k < 27; ++k) {
      for (std::int32_t o = heads_[slot({at[0] + k / 9 - 1, at[1] + k / 3 % 3 - 1, at[2] + k % 3 - 1})]; o >= 0;
           o = next_[static_cast<std::size_t>(o)]) {
        const Candidate& other = candidates_[static_cast<std::size_t>(o)];
        const Vector off = other.point - c.point;
        const double nearest = share * std::min(c.spacing, other.spacing);
        if (dot(off, off) < nearest * nearest && dot(other.normal, c.normal) > 0) return true;
      }
    }
    return false;
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

  const std::vector<Candidate>& candidates_;
  double cell_;
  std::vector<std::int32_t> heads_, next_;
};

/// `wanted` candidates, each as far from the others as goes: in random order, first with the distance of a dense
/// packing, then with ever smaller ones until there are enough. Ascending.
std::vector<std::int32_t> spread(const std::vector<Candidate>& candidates, Index wanted, std::uint64_t seed) {
  double largest = 0;
  for (const Candidate& c : candidates) largest = std::max(largest, c.spacing);
  const std::vector<Index> order =
      Random(seed, random_stream("avatar.order")).permutation(0, static_cast<Index>(candidates.size()));
  KeptPlaces kept(candidates, largest, wanted);
  std::vector<char> is_kept(candidates.size(), 0);
  std::vector<std::int32_t> result;
  for (double share = 0.84; static_cast<Index>(result.size()) < wanted; share = share < 1e-3 ? 0 : share * 0.95) {
    for (const Index i : order) {
      if (static_cast<Index>(result.size()) == wanted) break;
      const auto place = static_cast<std::int32_t>(i);
      if (is_kept[static_cast<std::size_t>(i)] != 0 || kept.crowded(place, share)) continue;
      is_kept[static_cast<std::size_t>(i)] = 1;
      kept.add(place);
      result.push_back(place);
    }
  }
  std::sort(result.begin(), result.end());
  return result;
}

/// The four largest weights at a place, of those of its triangle's corners.
void add_weights(const BodyModel& body, const Candidate& c, SparseWeights& weights) {
  constexpr std::size_t kKept = 4;
  std::vector<std::pair<double, std::int32_t>> all;
  const Index k = body.weights.per_vertex;
  for (std::size_t corner = 0; corner < 3; ++corner) {
    for (Index i = c.vertices[corner] * k; i < (c.vertices[corner] + 1) * k; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const std::int32_t joint = body.weights.indices[at];
      const auto found = std::find_if(all.begin(), all.end(), [&](const auto& entry) { return entry.second == joint; });
      const double weight = c.shares[corner] * body.weights.weights[at];
      if (found == all.end()) {
        all.emplace_back(weight, joint);
      } else {
        found->first += weight;
      }
    }
  }
  std::sort(all.begin(), all.end(),
            [](const auto& a, const auto& b) { return a.first != b.first ? a.first > b.first : a.second < b.second; });
  all.resize(kKept, {0.0, all[0].second});
  double sum = 0;
  for (const auto& entry : all) sum += entry.first;
  for (const auto& entry : all) {
    weights.indices.push_back(entry.second);
    weights.weights.push_back(entry.first / sum);
  }
}

/// Quaternion of a rotation that takes z to the normal.
Vector4<double> facing(const Vector& normal) {
  int least = 0;
  for (int i = 1; i < 3; ++i) {
    if (std::abs(normal[i]) < std::abs(normal[least])) least = i;
  }
  const Vector across = direction_of(cross(Vector(Vector::Unit(least)), normal)).unit;
  Matrix3<double> frame;
  frame.col(0) = across;
  frame.col(1) = cross(normal, across);
  frame.col(2) = normal;
  return quaternion_from_matrix(frame);
}

void append(std::vector<float>& to, std::initializer_list<double> numbers) {
  for (const double x : numbers) to.push_back(static_cast<float>(x));
}

}  // namespace

Avatar surface_avatar(const BodyModel& body, const AvatarSettings& settings) {
  require_range("gaussians", static_cast<double>(settings.gaussians), 1, 5e6);
  require_range("cover", settings.cover, 0.01, 100);
  require_range("thickness", settings.thickness, 1e-3, 10);
  require_range("opacity", settings.opacity, 1e-3, 1 - 1e-6);
  require_range("texture", settings.texture, 0, 1);
  HSI4D_CHECK(body.face_count() > 0, "the body has no surface");
  const detail::Clothing clothing(body, settings.texture);
  const std::vector<Candidate> candidates = draw_candidates(Surface(body), settings.gaussians, settings.seed);
  const Random noise(settings.seed, random_stream("avatar.color"));

  Avatar avatar;
  avatar.parents = body.parents;
  avatar.joints = body.joints;
  avatar.joint_names = body.joint_names;
  avatar.weights = {settings.gaussians, body.joint_count(), 4, {}, {}};
  for (const std::int32_t i : spread(candidates, settings.gaussians, settings.seed)) {
    const Candidate& c = candidates[static_cast<std::size_t>(i)];
    const Vector4<double> q = facing(c.normal);
    const double tangent = settings.cover * c.spacing;
    append(avatar.means, {c.point[0], c.point[1], c.point[2]});
    append(avatar.quats, {q[0], q[1], q[2], q[3]});
    append(avatar.log_scales, {std::log(tangent), std::log(tangent), std::log(tangent * settings.thickness)});
    append(avatar.opacity_logits, {std::log(settings.opacity / (1 - settings.opacity))});
    add_weights(body, c, avatar.weights);
    const int joint = avatar.weights.indices[avatar.weights.indices.size() - 4];
    const double speckle = 1 + 0.08 * settings.texture * (noise.uniform(static_cast<std::uint64_t>(i)) - 0.5);
    const Vector color = clothing.color(c.point, c.normal, joint) * speckle;
    append(avatar.colors, {color[0], color[1], color[2]});
  }
  avatar.weights = normalized_weights(std::move(avatar.weights), "avatar");
  return avatar;
}

}  // namespace hsi4d
