// Row P11: the operators of optim.
#include <cmath>
#include <memory>

#include "optim/solid/distance_grid.h"
#include "stress/poison.h"

namespace hsi4d::stress {

namespace {

/// Distances from a ball of 0.2 m, negative within.
std::shared_ptr<DistanceGrid> ball() {
  const auto distance = [](const Vector3<double>& place) { return place.norm() - 0.2; };
  return std::make_shared<DistanceGrid>(distance, DistanceGrid::Settings{.cell = 0.05, .reach = 1, .name = "ball"});
}

struct Distances {
  template <class S>
  std::vector<PoisonedOperator<S>> operator()() const {
    const auto grid = ball();
    std::vector<PoisonedOperator<S>> all;
    all.push_back({{{shape_of(40, 3), {}, -0.3, 0.3}},
                   [grid](const Vars<S>& in) { return Vars<S>{sampled_distance(in[0], grid)}; }});
    return all;
  }
};

}  // namespace

std::vector<StressFigure> poisoned_distances(Remedy remedy) { return family_leaks(Distances(), remedy); }

void add_optim_operators(OperatorNames& names) { add_family_operators(Distances(), names); }

}  // namespace hsi4d::stress
