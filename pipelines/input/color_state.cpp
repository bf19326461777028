#include "pipelines/input/color_state.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "core/check.h"

namespace hsi4d {

namespace {

constexpr const char* kMoments = "color_net/moments";
constexpr const char* kFeatureGroup = "avatar_features";
constexpr const char* kLayerGroup = "color_net";
constexpr std::string_view kCurvature = "curvature/";

std::string net_name(std::size_t person) { return person == 0 ? "color_net" : "color_net_" + std::to_string(person); }

std::string features_name(std::size_t person) { return net_name(person) + "/features"; }

/// The numbers of networks as a checkpoint names them.
/// @param with_features  of a person: whether features are among them
template <class Nets, class Has, class F>
void for_arrays(Nets& nets, const Has& with_features, const F& f) {
  for (std::size_t p = 0; p < nets.size(); ++p) {
    if (with_features(p)) f(features_name(p), nets[p].features);
    for (std::size_t l = 0; l < nets[p].layers.size(); ++l) {
      f(net_name(p) + "/weights" + std::to_string(l), nets[p].layers[l].weights);
      f(net_name(p) + "/bias" + std::to_string(l), nets[p].layers[l].bias);
    }
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

/// Moments are of the networks' arrays, one block each, or not there yet.
void check_moments(const Checkpoint& checkpoint, const ColorState& state) {
  std::vector<std::size_t> sizes, features;
  for_arrays(
      state.nets, [](std::size_t) { return false; },
      [&](const std::string&, const auto& numbers) { sizes.push_back(numbers.size()); });
  for (const ColorNet& net : state.nets) features.push_back(net.features.size());
  for (const auto& [group, moments] : state.moments) {
    const std::string name = std::string(kMoments) + "/" + group;
    const std::vector<std::size_t>& wanted = group == kFeatureGroup ? features : sizes;
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

ColorState first_color_state(std::vector<ColorNet> nets) {
  ColorState state{std::move(nets), {}};
  if (!state.nets.empty()) state.moments = {{kLayerGroup, {}}, {kFeatureGroup, {}}};
  return state;
}

void store_color_state(const ColorState& state, Checkpoint& checkpoint) {
  for (const auto& [stage, numbers] : state.curvature) {
    if (!numbers.empty()) checkpoint.set(std::string(kCurvature) + stage, numbers);
  }
  if (state.nets.empty()) return;
  for_arrays(
      state.nets, [&](std::size_t) { return features_moved(state); },
      [&](const std::string& name, const std::vector<double>& numbers) { checkpoint.set(name, numbers); });
  store_moments(state.moments, kMoments, checkpoint);
}

ColorState stored_color_state(const Checkpoint& checkpoint, ColorState first) {
  for (const std::string& name : checkpoint.names()) {
    if (!name.starts_with(kCurvature)) continue;
    check_net_finite(checkpoint, name, checkpoint.doubles(name));
    first.curvature[name.substr(kCurvature.size())] = checkpoint.doubles(name);
  }
  if (first.nets.empty()) return first;
  for_arrays(
      first.nets, [&](std::size_t person) { return checkpoint.has(features_name(person)); },
      [&](const std::string& name, std::vector<double>& numbers) {
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
