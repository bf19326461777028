// Rows B about sorting and counting.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "core/check.h"
#include "splat/render/tiles.h"
#include "stress/flat_splats.h"
#include "stress/measures.h"
#include "stress/rows.h"

namespace hsi4d::stress {

// --- B8 --------------------------------------------------------------------------------------------------------------

namespace {

constexpr int kImageSide = 8;  // of the images

/// Rows in another order: layers of equal depth are interleaved anew, each keeps the order within.
FlatSplats interleaved(const FlatSplats& splats, std::size_t layers) {
  std::vector<std::vector<Index>> rows(layers);
  for (Index n = splats.count() - 1; n >= 0; --n) rows[static_cast<std::size_t>(splats.depths[n]) - 2].push_back(n);
  RandomSequence random(15, 1);
  std::vector<Index> order;
  while (std::ssize(order) < splats.count()) {
    std::vector<Index>& layer = rows[random.below(layers)];
    if (layer.empty()) continue;
    order.push_back(layer.back());
    layer.pop_back();
  }
  return splats.picked(order);
}

/// Rows of equal depth in layers 2, 3, …, small Gaussians all over the image.
FlatSplats layered_splats(Index n, std::uint64_t layers) {
  FlatSplats splats = random_splats(n, kImageSide, kImageSide, 1, 14);
  RandomSequence random(16, 1);
  for (double& z : splats.depths) z = 2 + static_cast<double>(random.below(layers));
  for (double& v : splats.factors) v = static_cast<double>(static_cast<float>(v / 3));
  return splats;
}

/// Front to back in the given order, in float, of round Gaussians of radius 1.
std::vector<double> plain_image(const FlatSplats& splats, const std::vector<Index>& order) {
  std::vector<double> image;
  for (int p = 0; p < kImageSide * kImageSide; ++p) {
    const auto x = static_cast<float>(p % kImageSide) + 0.5f, y = static_cast<float>(p / kImageSide) + 0.5f;
    float t = 1, color = 0;
    for (const Index n : order) {
      const float dx = x - static_cast<float>(splats.means[2 * n]),
                  dy = y - static_cast<float>(splats.means[2 * n + 1]);
      const float alpha = static_cast<float>(splats.opacities[n]) * std::exp(-0.5f * (dx * dx + dy * dy));
      color += t * alpha * static_cast<float>(splats.features[n]);
      t *= 1 - alpha;
      if (t < 1e-4f) break;
    }
    image.push_back(static_cast<double>(color));
  }
  return image;
}

std::vector<Index> rows_of_depths(const FlatSplats& splats) {
  std::vector<Index> rows(splats.depths.size());
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = static_cast<Index>(i);
  return rows;
}

/// By depth alone, ties as they come.
std::vector<double> unstable_image(const FlatSplats& splats) {
  std::vector<Index> order = rows_of_depths(splats);
  std::sort(order.begin(), order.end(), [&](Index a, Index b) { return splats.depths[a] < splats.depths[b]; });
  return plain_image(splats, order);
}

/// By a comparison that NaN takes part in. By insertion, which is defined even then; std::sort would not be.
std::vector<double> compared_image(const FlatSplats& splats) {
  std::vector<Index> order = rows_of_depths(splats), drawn;
  for (std::size_t i = 1; i < order.size(); ++i) {
    for (std::size_t k = i; k > 0 && splats.depths[order[k]] < splats.depths[order[k - 1]]; --k) {
      std::swap(order[k], order[k - 1]);
    }
  }
  for (const Index n : order) {
    if (std::isfinite(splats.depths[n])) drawn.push_back(n);
  }
  return plain_image(splats, drawn);
}

}  // namespace

std::vector<StressFigure> depth_sort(Remedy remedy) {
  const SplatView view = front_view(kImageSide, kImageSide);
  const bool on = remedy == Remedy::kOn;
  const FlatSplats ties = layered_splats(100'000, 4), dealt = interleaved(ties, 4);
  FlatSplats broken = layered_splats(2000, 1000);
  std::vector<Index> sound;
  for (Index n = 0; n < broken.count(); ++n) {
    if (n % 20 == 7) broken.depths[n] = std::numeric_limits<double>::quiet_NaN();
    if (n % 20 != 7) sound.push_back(n);
  }
  const auto of_ties = [&](const FlatSplats& splats) {
    return on ? FlatRender<float>(splats, view).image() : unstable_image(splats);
  };
  const auto of_broken = [&](const FlatSplats& splats) {
    return on ? FlatRender<float>(splats, view).image() : compared_image(splats);
  };
  return {
      {"colours changed: rows anew, ties in their order", unequal(of_ties(dealt), of_ties(ties)), 0},
      {"colours changed by rows whose depth is NaN", unequal(of_broken(broken), of_broken(broken.picked(sound))), 0}};
}

// --- B9 --------------------------------------------------------------------------------------------------------------

std::vector<StressFigure> depth_keys(Remedy remedy) {
  constexpr double kInf = std::numeric_limits<double>::infinity();
  const std::array<double, 9> depths = {-kInf, -1, -2e-38, -0.0, 0.0, 2e-38, 0.5, 1, kInf};
  const bool on = remedy == Remedy::kOn;
  const auto key = [&](auto depth) -> std::uint64_t {
    using Bits = std::conditional_t<sizeof depth == 4, std::uint32_t, std::uint64_t>;
    return on ? detail::depth_bits(depth) : std::bit_cast<Bits>(depth);
  };
  double disorder = 0;
  const auto sort = [&](const auto& key_of) {
    std::vector<detail::DepthKeyed> keys, room(depths.size());
    for (std::size_t i = 0; i < depths.size(); ++i) {  // 4 and 9 have no common factor: all of them, mixed
      const auto n = static_cast<std::int32_t>(4 * i % depths.size());
      keys.push_back({key_of(depths[n]), n});
    }
    const auto sorted = detail::sort_by_depth(keys, room);
    for (std::size_t i = 1; i < sorted.size(); ++i) {
      disorder += depths[sorted[i].index] < depths[sorted[i - 1].index] ? 1 : 0;
    }
  };
  sort([&](double depth) { return key(static_cast<float>(depth)); });
  sort([&](double depth) { return key(depth); });
  const double zeros = (key(-0.0f) != key(0.0f) ? 1 : 0) + (key(-0.0) != key(0.0) ? 1 : 0);
  return {{"neighbours in the wrong order", disorder, 0}, {"types in which -0 is not 0", zeros, 0}};
}

// --- B10 -------------------------------------------------------------------------------------------------------------

namespace {

/// What becomes of requests for memory, some within it and some beyond it.
struct MemoryRequests {
  double gigabytes_beyond = 0;  ///< of the largest that is let through
  double refused = 0;           ///< of those within
};

MemoryRequests memory_requests(Remedy remedy) {
  constexpr double kMemory = 12e9;
  MemoryRequests result;
  for (const double bytes : {1e9, 11.9e9, 12.1e9, 96e9}) {
    try {
      if (remedy == Remedy::kOn)
        detail::check_pair_memory(static_cast<Index>(bytes / 48), bytes, static_cast<Index>(kMemory));
      result.gigabytes_beyond = std::max(result.gigabytes_beyond, (bytes - kMemory) / 1e9);
    } catch (const UserError&) {
      result.refused += bytes <= kMemory ? 1 : 0;
    }
  }
  return result;
}

}  // namespace

std::vector<StressFigure> pair_counts(Remedy remedy) {
  // How far off the sum is that one would go on with; 0 where it is refused.
  const auto off = [remedy](const std::vector<Index>& pairs) {
    Index expected = 0;
    std::uint32_t wrapped = 0;
    for (const Index count : pairs) {
      expected += count;
      wrapped += static_cast<std::uint32_t>(count);
    }
    if (remedy == Remedy::kOff) return std::abs(static_cast<double>(std::bit_cast<std::int32_t>(wrapped) - expected));
    try {
      return std::abs(static_cast<double>(detail::total_pairs(pairs) - expected));
    } catch (const UserError&) {
      return 0.0;
    }
  };
  constexpr Index kBillion = 1'000'000'000;
  // Gaussians that reach every one of 900 tiles.
  FlatSplats wide;
  for (int i = 0; i < 30; ++i) wide.add(120, 120, 1 + i, 500, 0.01, {1});
  SplatView view = front_view(240, 240);
  view.settings.tile = 8;
  const FlatRender<float> render(wide, view);
  const MemoryRequests requests = memory_requests(remedy);
  return {
      {"sum of 3e9 pairs off, where it is not refused", off({kBillion, kBillion, kBillion}), 0},
      {"sum of 2e9 pairs off", off({kBillion, kBillion}), 0},
      {"pairs of 30 Gaussians in 900 tiles off", std::abs(static_cast<double>(render.out.counters->pairs - 27'000)), 0},
      {"GB taken beyond a memory of 12", requests.gigabytes_beyond, 0},
      {"requests within it that are refused, of 2", requests.refused, 0}};
}

}  // namespace hsi4d::stress
