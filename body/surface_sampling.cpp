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

/// A place on the surface, as small as goes: there are many.
struct SamplePlace {
  std::array<float, 3> point;  // metres
  float spacing;               // that is wanted, metres
  std::int32_t face;

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
  double unit_spacing;              // metres, where the density is 1

  Surface(const BodyModel& model, std::span<const double> densities, Index count) : body(model), density(densities) {
    double sum = 0;
    for (std::int32_t face = 0; face < body.face_count(); ++face) {
      const std::array<Vector, 3> c = face_corners(body, face);
      const Direction<double, 3> area = direction_of(cross(Vector(c[1] - c[0]), Vector(c[2] - c[0])));
      normals.push_back(area.unit);
      sum += 0.5 * area.length * density_at(face, {1.0 / 3, 1.0 / 3, 1.0 / 3});
      cumulative.push_back(sum);
    }
    HSI4D_CHECK(sum > 0, "the body's surface has no area");
    unit_spacing = std::sqrt(sum / static_cast<double>(count));
  }

  double density_at(std::int32_t face, const std::array<double, 3>& shares) const {
    double result = 0;
    for (std::size_t i = 0; i < 3; ++i)
      result += shares[i] * density[static_cast<std::size_t>(body.faces[3 * static_cast<std::size_t>(face) + i])];
    return result;
  }
  const Vector& normal(std::int32_t face) const { return normals[static_cast<std::size_t>(face)]; }

  SamplePlace place(std::int32_t face, const std::array<double, 3>& shares) const {
    const std::array<Vector, 3> c = face_corners(body, face);
    const Vector point = c[0] * shares[0] + c[1] * shares[1] + c[2] * shares[2];
    return {{static_cast<float>(point[0]), static_cast<float>(point[1]), static_cast<float>(point[2])},
            static_cast<float>(unit_spacing / std::sqrt(density_at(face, shares))),
            face};
  }
};

/// Places in strata of equal share, evenly within each triangle.
std::vector<SamplePlace> draw_candidates(const Surface& surface, Index count, std::uint64_t seed) {
  const Random along(seed, random_stream("avatar.triangle")), in_a(seed, random_stream("avatar.u")),
      in_b(seed, random_stream("avatar.v"));
  std::vector<SamplePlace> candidates(static_cast<std::size_t>(count));
  parallel_for(count, kGrain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const auto at = static_cast<std::uint64_t>(i);
      const double target =
          (static_cast<double>(i) + along.uniform(at)) / static_cast<double>(count) * surface.cumulative.back();
      const auto found = std::upper_bound(surface.cumulative.begin(), surface.cumulative.end() - 1, target);
      double u = in_a.uniform(at), v = in_b.uniform(at);
      if (u + v > 1) u = 1 - u, v = 1 - v;
      candidates[static_cast<std::size_t>(i)] =
          surface.place(static_cast<std::int32_t>(found - surface.cumulative.begin()), {1 - u - v, u, v});
    }
  });
  return candidates;
}

/// Places found by where they are: a hash table of cells, as wide as the largest distance of neighbours.
class Grid {
 public:
  Grid(const Surface& surface, double cell, Index wanted) : surface_(surface), cells_per_metre_(1 / cell), cell_(cell) {
    std::size_t size = 64;
    while (size < static_cast<std::size_t>(2 * wanted)) size *= 2;
    heads_.assign(size, -1);
    entries_.reserve(static_cast<std::size_t>(wanted));
  }

  void add(const SamplePlace& place) {
    const std::uint64_t cell = key_of(cell_of(place.position()));
    std::int32_t& head = heads_[slot(cell)];
    const Vector& n = surface_.normal(place.face);
    entries_.push_back({cell,
                        place.point,
                        {static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2])},
                        place.spacing,
                        head});
    head = static_cast<std::int32_t>(entries_.size()) - 1;
  }

  /// Squared distance of a place that was added; infinity on another side.
  double squared_distance(std::int32_t i, const SamplePlace& place) const {
    const Entry& entry = entries_[static_cast<std::size_t>(i)];
    if (!same_side(entry, surface_.normal(place.face))) return std::numeric_limits<double>::infinity();
    return squared_distance(entry, place.position());
  }

  /// Calls found(i, squared distance, its spacing) for places on the same side that are nearer than `reach`; it returns
  /// how far to look from there on.
  template <class F>
  void around(const SamplePlace& place, double reach, F&& found) const {
    const Vector point = place.position(), &normal = surface_.normal(place.face);
    const std::array<std::int64_t, 3> at = cell_of(point);
    std::array<std::array<double, 3>, 3> ways;  // squared, to the cells along each axis
    for (std::size_t i = 0; i < 3; ++i) {
      const double into = point[static_cast<Index>(i)] - static_cast<double>(at[i]) * cell_, left = cell_ - into;
      ways[i] = {into * into, 0, left * left};
    }
    for (const auto& step : kSteps) {
      const double off = ways[0][step[0]] + ways[1][step[1]] + ways[2][step[2]];
      if (off > reach * reach) continue;
      const std::array<std::int64_t, 3> cell = {at[0] + step[0] - 1, at[1] + step[1] - 1, at[2] + step[2] - 1};
      const std::uint64_t key = key_of(cell);
      for (std::int32_t o = heads_[slot(key)]; o >= 0; o = entries_[static_cast<std::size_t>(o)].next) {
        const Entry& other = entries_[static_cast<std::size_t>(o)];
        if (other.cell != key || !same_side(other, normal)) continue;
        const double squared = squared_distance(other, point);
        if (squared <= reach * reach) reach = found(o, squared, static_cast<double>(other.spacing));
      }
    }
  }

 private:
  struct Entry {
    std::uint64_t cell;
    std::array<float, 3> point, normal;
    float spacing;
    std::int32_t next;
  };
  static bool same_side(const Entry& e, const Vector& normal) {
    return static_cast<double>(e.normal[0]) * normal[0] + static_cast<double>(e.normal[1]) * normal[1] +
               static_cast<double>(e.normal[2]) * normal[2] >
           0;
  }
  static double squared_distance(const Entry& e, const Vector& point) {
    double sum = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const double way = static_cast<double>(e.point[i]) - point[static_cast<Index>(i)];
      sum += way * way;
    }
    return sum;
  }

  /// To a cell and those around it, the nearest first; 1 is none.
  static constexpr std::array<std::array<unsigned char, 3>, 27> kSteps = [] {
    std::array<std::array<unsigned char, 3>, 27> steps{};
    std::size_t count = 0;
    for (int away = 0; away <= 3; ++away) {
      for (int k = 0; k < 27; ++k) {
        if ((k / 9 != 1) + (k / 3 % 3 != 1) + (k % 3 != 1) != away) continue;
        steps[count++] = {static_cast<unsigned char>(k / 9), static_cast<unsigned char>(k / 3 % 3),
                          static_cast<unsigned char>(k % 3)};
      }
    }
    return steps;
  }();

  std::array<std::int64_t, 3> cell_of(const Vector& p) const {
    return {static_cast<std::int64_t>(std::floor(p[0] * cells_per_metre_)),
            static_cast<std::int64_t>(std::floor(p[1] * cells_per_metre_)),
            static_cast<std::int64_t>(std::floor(p[2] * cells_per_metre_))};
  }
  /// 21 bits a coordinate: bodies are no million cells wide.
  static std::uint64_t key_of(const std::array<std::int64_t, 3>& c) {
    std::uint64_t key = 0;
    for (const std::int64_t x : c) key = key << 21 | (static_cast<std::uint64_t>(x) & 0x1FFFFF);
    return key;
  }
  std::size_t slot(std::uint64_t key) const {
    return static_cast<std::size_t>((key ^ key >> 32) * 0x9E3779B97F4A7C15u >> 32) & (heads_.size() - 1);
  }

  const Surface& surface_;
  double cells_per_metre_, cell_;
  std::vector<std::int32_t> heads_;
  std::vector<Entry> entries_;
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
    double least = std::numeric_limits<double>::infinity();
    for (const double density : surface.density) least = std::min(least, density);
    largest_spacing_ = surface.unit_spacing / std::sqrt(least);
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
  /// As many candidates as are wanted, in random order, first with the distance of a dense packing, then with ever
  /// smaller ones until there are enough. Every other one is tried: moving makes up for the rest.
  void throw_darts() {
    constexpr Index kTried = 2;
    std::vector<Index> order =
        Random(seed_, random_stream("avatar.order")).permutation(0, std::ssize(candidates_) / kTried);
    for (Index& i : order) i *= kTried;
    Grid grid(surface_, largest_spacing_, wanted_);
    for (double share = 0.8; std::ssize(kept_) < wanted_; share = share < 1e-3 ? 0 : share * 0.93) {
      std::vector<Index> left;
      for (const Index i : order) {
        if (std::ssize(kept_) == wanted_) break;
        const SamplePlace& place = candidates_[static_cast<std::size_t>(i)];
        const auto spacing = static_cast<double>(place.spacing);
        bool crowded = false;
        grid.around(place, share * spacing, [&](std::int32_t, double squared, double other) {
          const double nearest = share * std::min(spacing, other);
          crowded = crowded || squared < nearest * nearest;
          return crowded ? 0 : share * spacing;
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

  /// The kept place that is nearest to each candidate, on its side; ties: the lower one.
  void find_owners() {
    Grid grid(surface_, largest_spacing_, wanted_);
    for (const SamplePlace& place : kept_) grid.add(place);
    parallel_for(static_cast<Index>(candidates_.size()), kGrain, [&](Index begin, Index end) {
      for (Index i = begin; i < end; ++i) {
        const SamplePlace& place = candidates_[static_cast<std::size_t>(i)];
        // The one of before is still near.
        std::int32_t& owner = owners_[static_cast<std::size_t>(i)];
        double nearest = owner < 0 ? std::numeric_limits<double>::infinity() : grid.squared_distance(owner, place);
        if (!std::isfinite(nearest)) owner = -1;
        grid.around(place, std::sqrt(nearest), [&](std::int32_t o, double squared, double) {
          if (squared < nearest || (squared == nearest && o < owner)) nearest = squared, owner = o;
          return std::sqrt(nearest) * (1 + 1e-12);
        });
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
      const auto spacing = static_cast<double>(candidates_[i].spacing);
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
      const std::int32_t face = nearest[k].second;
      if (face < 0) continue;
      const Vector middle = sums[k].head<3>() / sums[k][3];
      kept_[k] = surface_.place(face, nearest_on_triangle(face_corners(surface_.body, face), middle).shares);
    }
  }

  std::vector<SurfaceSample> measured() const {
    std::vector<SurfaceSample> samples(kept_.size());
    for (std::size_t k = 0; k < kept_.size(); ++k) {
      samples[k].place = nearest_on_triangle(face_corners(surface_.body, kept_[k].face), kept_[k].position());
      samples[k].place.face = kept_[k].face;
      samples[k].wanted_spacing = static_cast<double>(kept_[k].spacing);
    }
    for (std::size_t i = 0; i < candidates_.size(); ++i) {
      if (owners_[i] < 0) continue;
      SurfaceSample& sample = samples[static_cast<std::size_t>(owners_[i])];
      const Vector off = candidates_[i].position() - sample.place.point;
      const auto wanted = static_cast<double>(candidates_[i].spacing);
      sample.spacing += wanted * wanted / static_cast<double>(kCandidates);  // its share of the area
      sample.reach = std::max(sample.reach, std::sqrt(dot(off, off)));
      const double away = dot(off, surface_.normal(sample.place.face));
      sample.bend = std::max(sample.bend, std::abs(away));
    }
    for (SurfaceSample& sample : samples) sample.spacing = std::sqrt(sample.spacing);
    std::stable_sort(samples.begin(), samples.end(),
                     [](const SurfaceSample& a, const SurfaceSample& b) { return a.place.face < b.place.face; });
    return samples;
  }

  const Surface& surface_;
  Index wanted_;
  std::uint64_t seed_;
  std::vector<SamplePlace> candidates_;
  std::vector<std::int32_t> owners_;  // by candidate
  std::vector<SamplePlace> kept_;
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
  const Surface surface(body, density, count);
  return Sampling(surface, count, seed).result();
}

}  // namespace hsi4d
