#include "pipelines/input/color_state.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "core/check.h"

namespace hsi4d {

namespace {

constexpr const char* kFeatures = "color_net/features";
constexpr const char* kMoments = "color_net/moments";
constexpr const char* kFeatureGroup = "avatar_features";
constexpr const char* kLayerGroup = "color_net";
constexpr std::string_view kCurvature = "curvature/";

/// The numbers of a network as a checkpoint names them; `with_features` says whether they are among them.
template <class Net, class F>
void for_arrays(Net& net, bool with_features, const F& f) {
  if (with_features) f(std::string(kFeatures), net.features);
  for (std::size_t l = 0; l < net.layers.size(); ++l) {
    f("color_net/weights" + std::to_string(l), net.layers[l].weights);
    f("color_net/bias" + std::to_string(l), net.layers[l].bias);
  }
}

void check_net_finite(const Checkpoint& checkpoint, const std::string& name, const std::vector<double>& numbers) {
  if (std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); })) return;
  throw DataError(checkpoint.source() + ": \"" + name + "\" holds a number that is not finite");
}

void check_net_numbers(const Checkpoint& checkpoint, const std::string& name, const std::vector<double>& numbers,
                       std::size_t wanted) {
  if (numbers.size() != wanted) {
    throw DataError(checkpoint.source() + ": \"" + name + "\" holds " + std::to_string(numbers.size()) +
                    " numbers, this color net has " + std::to_string(wanted) +
                    "; the inputs have changed since the run began");
  }
  check_net_finite(checkpoint, name, numbers);
}

/// Moments are of the network's arrays, one block each, or not there yet.
void check_moments(const Checkpoint& checkpoint, const ColorState& state) {
  std::vector<std::size_t> sizes;
  for_arrays(*state.net, false, [&](const std::string&, const auto& numbers) { sizes.push_back(numbers.size()); });
  for (const auto& [group, moments] : state.moments) {
    const std::string name = std::string(kMoments) + "/" + group;
    const std::vector<std::size_t> wanted = group == kFeatureGroup ? std::vector{state.net->features.size()} : sizes;
    if (moments.blocks.empty()) continue;
    if (moments.blocks.size() != wanted.size()) {
      throw DataError(checkpoint.source() + ": \"" + name + "\" has " + std::to_string(moments.blocks.size()) +
                      " blocks, this color net has " + std::to_string(wanted.size()));
    }
    for (std::size_t b = 0; b < wanted.size(); ++b) {
      const std::string block = name + "/" + std::to_string(b);
      check_net_numbers(checkpoint, block + "/mean", moments.blocks[b].mean, wanted[b]);
      check_net_numbers(checkpoint, block + "/square", moments.blocks[b].square, wanted[b]);
    }
  }
}

bool features_moved(const ColorState& state) {
  const auto moments = state.moments.find(kFeatureGroup);
  return moments != state.moments.end() && !moments->second.blocks.empty();
}

}  // namespace

ColorState first_color_state(std::optional<ColorNet> net) {
  ColorState state{std::move(net), {}};
  if (state.net) state.moments = {{kLayerGroup, {}}, {kFeatureGroup, {}}};
  return state;
}

void store_color_state(const ColorState& state, Checkpoint& checkpoint) {
  for (const auto& [stage, numbers] : state.curvature) {
    if (!numbers.empty()) checkpoint.set(std::string(kCurvature) + stage, numbers);
  }
  if (!state.net) return;
  for_arrays(*state.net, features_moved(state),
             [&](const std::string& name, const std::vector<double>& numbers) { checkpoint.set(name, numbers); });
  store_moments(state.moments, kMoments, checkpoint);
}

ColorState stored_color_state(const Checkpoint& checkpoint, ColorState first) {
  for (const std::string& name : checkpoint.names()) {
    if (!name.starts_with(kCurvature)) continue;
    check_net_finite(checkpoint, name, checkpoint.doubles(name));
    first.curvature[name.substr(kCurvature.size())] = checkpoint.doubles(name);
  }
  if (!first.net) return first;
  for_arrays(*first.net, checkpoint.has(kFeatures), [&](const std::string& name, std::vector<double>& numbers) {
    const std::vector<double>& found = checkpoint.doubles(name);
    check_net_numbers(checkpoint, name, found, numbers.size());
    numbers = found;
  });
  for (const auto& [group, moments] : stored_moments(checkpoint, kMoments)) {
    const auto known = first.moments.find(group);
    if (known != first.moments.end()) known->second = moments;
  }
  check_moments(checkpoint, first);
  return first;
}

}  // namespace hsi4d
