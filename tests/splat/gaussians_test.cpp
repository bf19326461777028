#include "splat/gaussians.h"

#include <array>

#include <catch2/catch.hpp>

#include "core/check.h"

namespace gaussians_test {

using namespace hsi4d;

namespace {

/// n Gaussians whose numbers are all different.
Gaussians counted(Index n, int degree, float first) {
  Gaussians g;
  g.sh_degree = degree;
  float next = first;
  const auto fill = [&next](std::vector<float>& values, Index count) {
    for (Index i = 0; i < count; ++i) values.push_back(next++);
  };
  fill(g.means, 3 * n);
  fill(g.quats, 4 * n);
  fill(g.log_scales, 3 * n);
  fill(g.opacity_logits, n);
  fill(g.sh, 3 * n * g.sh_coefficients());
  return g;
}

}  // namespace

TEST_CASE("arrays of Gaussians must fit each other") {
  CHECK(Gaussians{}.count() == 0);
  CHECK_NOTHROW(check_sizes(Gaussians{}));
  CHECK_NOTHROW(check_sizes(counted(4, 3, 0)));
  CHECK(counted(4, 3, 0).sh_coefficients() == 16);
  for (auto member :
       {&Gaussians::means, &Gaussians::quats, &Gaussians::log_scales, &Gaussians::opacity_logits, &Gaussians::sh}) {
    Gaussians g = counted(4, 1, 0);
    (g.*member).push_back(0);
    CHECK_THROWS_AS(check_sizes(g), InternalError);
  }
  Gaussians g = counted(4, 1, 0);
  g.sh_degree = 2;
  CHECK_THROWS_AS(check_sizes(g), InternalError);
  g.sh_degree = -1;
  CHECK_THROWS_AS(check_sizes(g), InternalError);
}

TEST_CASE("Gaussians are put one after the other, harmonics padded") {
  const Gaussians a = counted(2, 0, 1), b = counted(1, 2, 100), none;
  const std::array<const Gaussians*, 3> parts = {&a, &none, &b};
  const Gaussians all = concatenated(parts);
  check_sizes(all);
  CHECK(all.count() == 3);
  CHECK(all.sh_degree == 2);
  for (std::size_t i = 0; i < 6; ++i) CHECK(all.means[i] == a.means[i]);
  for (std::size_t i = 0; i < 3; ++i) CHECK(all.means[6 + i] == b.means[i]);
  for (std::size_t i = 0; i < 4; ++i) CHECK(all.quats[8 + i] == b.quats[i]);
  CHECK(all.opacity_logits[1] == a.opacity_logits[1]);
  CHECK(all.opacity_logits[2] == b.opacity_logits[0]);
  for (std::size_t n = 0; n < 2; ++n) {
    for (std::size_t i = 0; i < 27; ++i) CHECK(all.sh[27 * n + i] == (i < 3 ? a.sh[3 * n + i] : 0));
  }
  for (std::size_t i = 0; i < 27; ++i) CHECK(all.sh[54 + i] == b.sh[i]);
  CHECK(concatenated({}).count() == 0);
}

TEST_CASE("Gaussians with different origins are not put together") {
  const Gaussians a = counted(2, 0, 1);
  Gaussians b = counted(1, 0, 1);
  b.origin_world = {1, 0, 0};
  const std::array<const Gaussians*, 2> parts = {&a, &b};
  CHECK_THROWS_AS(concatenated(parts), InternalError);
}

TEST_CASE("rows of Gaussians are picked, harmonics cut and padded") {
  Gaussians g = counted(5, 2, 0);
  g.origin_world = {1, 2, 3};
  const std::array<Index, 3> rows = {4, 0, 4};
  const Gaussians picked = selected(g, rows);
  check_sizes(picked);
  CHECK(picked.origin_world == g.origin_world);
  CHECK(picked.means[0] == g.means[12]);
  CHECK(picked.means[3] == g.means[0]);
  CHECK(picked.quats[11] == g.quats[19]);
  CHECK(picked.sh[27 * 2 + 26] == g.sh[27 * 4 + 26]);
  const std::array<Index, 1> none = {5};
  CHECK_THROWS_AS(selected(g, none), InternalError);
  const Gaussians less = with_sh_degree(g, 1), more = with_sh_degree(g, 3);
  for (std::size_t n = 0; n < 5; ++n) {
    for (std::size_t i = 0; i < 12; ++i) CHECK(less.sh[12 * n + i] == g.sh[27 * n + i]);
    for (std::size_t i = 0; i < 48; ++i) CHECK(more.sh[48 * n + i] == (i < 27 ? g.sh[27 * n + i] : 0));
  }
  CHECK(with_sh_degree(g, 2).sh == g.sh);
  CHECK_THROWS_AS(with_sh_degree(g, 4), InternalError);
}

}  // namespace gaussians_test
