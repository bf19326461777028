#include "splat/files/info.h"

#include <cmath>

#include <catch2/catch.hpp>

namespace info_test {

using namespace hsi4d;

TEST_CASE("distributions are by nearest rank") {
  std::vector<float> values;
  for (int i = 100; i >= 1; --i) values.push_back(static_cast<float>(i));
  const Distribution d = distribution_of(values);
  CHECK(d.smallest == 1);
  CHECK(d.percentile_5 == 5);
  CHECK(d.median == 50);
  CHECK(d.percentile_95 == 95);
  CHECK(d.largest == 100);
  const Distribution one = distribution_of({7});
  CHECK(one.smallest == 7);
  CHECK(one.percentile_5 == 7);
  CHECK(one.percentile_95 == 7);
  CHECK(distribution_of({}).largest == 0);
}

TEST_CASE("statistics of Gaussians are of activated numbers in the world") {
  Gaussians g;
  g.origin_world = {10, 0, 0};
  g.means = {1, 2, 3, -1, 5, 0};
  g.quats = {1, 0, 0, 0, 1, 0, 0, 0};
  g.log_scales = {0, 0, std::log(2.0F), 0, 0, std::log(0.5F)};
  g.opacity_logits = {0, 20};
  g.sh.resize(6);
  const GaussianStatistics s = statistics_of(g);
  CHECK(s.count == 2);
  CHECK(s.sh_degree == 0);
  CHECK(s.lower_world == Vector3<double>(9, 2, 0));
  CHECK(s.upper_world == Vector3<double>(11, 5, 3));
  CHECK(s.opacity.smallest == 0.5);
  CHECK(s.opacity.largest == Approx(1));
  CHECK(s.scale.smallest == Approx(0.5));
  CHECK(s.scale.median == 1);
  CHECK(s.scale.largest == Approx(2));
  CHECK(statistics_of(Gaussians{}).count == 0);
}

TEST_CASE("histograms count every number once") {
  const std::vector<float> values = {-5, 0, 0.5F, 1, 1.5F, 2, 7};
  const Histogram h = histogram_of(values, {0, 1, 2});
  CHECK(h.counts == std::vector<Index>{3, 4});  // an edge belongs to the bin above it, the last one to the last
  Gaussians g;
  g.means.resize(6);
  g.quats.resize(8);
  g.log_scales = {0, 0, 0, std::log(0.02F), 0, std::log(30.0F)};
  g.opacity_logits = {-20, 20};
  g.sh.resize(6);
  const GaussianStatistics s = statistics_of(g);
  CHECK(s.opacity_histogram.counts == std::vector<Index>{1, 0, 0, 0, 0, 0, 0, 0, 0, 1});
  CHECK(s.scale_histogram.edges.size() == 5);
  CHECK(s.scale_histogram.edges.front() == Approx(0.01));
  CHECK(s.scale_histogram.edges.back() == Approx(100));
  CHECK(s.scale_histogram.counts == std::vector<Index>{1, 0, 4, 1});
  CHECK(s.suspicions.duplicates == 1);
  CHECK(s.suspicions.transparent == 1);
  CHECK(s.suspicions.huge == 0);  // all at one place: there is no scene to be larger than
}

}  // namespace info_test
