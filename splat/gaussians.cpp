#include "splat/gaussians.h"

#include <algorithm>

#include "core/check.h"
#include "core/gather.h"
#include "splat/limits.h"

namespace hsi4d {
namespace {

void append(std::vector<float>& all, const std::vector<float>& part) {
  all.insert(all.end(), part.begin(), part.end());
}

/// Appends [n,K,3] as [n,K',3] with K' ≥ K.
void append_sh(std::vector<float>& all, const Gaussians& part, int coefficients) {
  const Index from = 3 * Index{part.sh_coefficients()}, to = 3 * Index{coefficients};
  const Index begin = static_cast<Index>(all.size());
  all.resize(static_cast<std::size_t>(begin + part.count() * to), 0.0F);
  for (Index n = 0; n < part.count(); ++n) std::copy_n(part.sh.begin() + n * from, from, all.begin() + begin + n * to);
}

}  // namespace

void check_sizes(const Gaussians& gaussians) {
  HSI4D_CHECK(gaussians.sh_degree >= 0 && gaussians.sh_degree <= kHighestShDegree,
              "the degree of spherical harmonics is " + std::to_string(gaussians.sh_degree));
  const std::size_t n = gaussians.opacity_logits.size();
  HSI4D_CHECK_EQ(gaussians.means.size(), 3 * n);
  HSI4D_CHECK_EQ(gaussians.quats.size(), 4 * n);
  HSI4D_CHECK_EQ(gaussians.log_scales.size(), 3 * n);
  HSI4D_CHECK_EQ(gaussians.sh.size(), 3 * n * static_cast<std::size_t>(gaussians.sh_coefficients()));
}

Gaussians concatenated(std::span<const Gaussians* const> parts) {
  Gaussians all;
  if (parts.empty()) return all;
  all.origin_world = parts.front()->origin_world;
  for (const Gaussians* part : parts) {
    check_sizes(*part);
    HSI4D_CHECK(part->origin_world == all.origin_world, "Gaussians with different origins were put together");
    all.sh_degree = std::max(all.sh_degree, part->sh_degree);
  }
  for (const Gaussians* part : parts) {
    append(all.means, part->means);
    append(all.quats, part->quats);
    append(all.log_scales, part->log_scales);
    append(all.opacity_logits, part->opacity_logits);
    append_sh(all.sh, *part, all.sh_coefficients());
  }
  return all;
}

Gaussians selected(const Gaussians& gaussians, std::span<const Index> rows) {
  check_sizes(gaussians);
  Gaussians out;
  out.sh_degree = gaussians.sh_degree;
  out.origin_world = gaussians.origin_world;
  out.means = gathered(gaussians.means, rows, 3);
  out.quats = gathered(gaussians.quats, rows, 4);
  out.log_scales = gathered(gaussians.log_scales, rows, 3);
  out.opacity_logits = gathered(gaussians.opacity_logits, rows, 1);
  out.sh = gathered(gaussians.sh, rows, 3 * Index{gaussians.sh_coefficients()});
  return out;
}

Gaussians with_sh_degree(const Gaussians& gaussians, int degree) {
  check_sizes(gaussians);
  Gaussians out = gaussians;
  out.sh_degree = degree;
  const Index from = 3 * Index{gaussians.sh_coefficients()}, to = 3 * Index{out.sh_coefficients()};
  out.sh.assign(static_cast<std::size_t>(gaussians.count() * to), 0.0F);
  for (Index n = 0; n < gaussians.count(); ++n)
    std::copy_n(gaussians.sh.begin() + n * from, std::min(from, to), out.sh.begin() + n * to);
  check_sizes(out);
  return out;
}

}  // namespace hsi4d
