// Where a hidden object was, once frames on both sides show it.
//
// With its carrier it moves evenly from where one frame shows it to where the other does. Frames may say that this is
// wrong: more of the object would show there than does, as when it is put down behind something and the chest that it
// went with stays above. Then a hand carries it from both sides, as far as nothing speaks against that: of those that
// touch it at an end the one whose place the images know better. If it does not get from one side to the other, the
// object was put down where that hand has it lowest, and taken where it has it lowest on the other side. In between it
// moves evenly.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "pipelines/input/clip.h"
#include "pipelines/input/state.h"
#include "pipelines/run/hidden_objects.h"

namespace hsi4d {

/// Frames that hide an object, or show too little of it to tell where it is, between two that show it.
struct HiddenGap {
  std::size_t object = 0, begin = 0, end = 0;
};

/// Whether a frame cannot have the object where a state has it.
using Contradicted = std::function<bool(std::size_t frame, const SceneState& state)>;

/// Lays an object in frames between `begin` and `end`, which show it, on a path that turns and moves evenly as its
/// carrier sees it.
void lay_between(const Clip& clip, const Carrier& carrier, std::size_t object, std::size_t begin, std::size_t end,
                 std::vector<SceneState>& states);

/// As lay_between, unless frames contradict. What was done then, for the log; else "".
/// @param sigmas  by frame; none: the object goes with its carrier, whatever frames say
std::string lay_gap(const Clip& clip, const Carrier& carrier, const HiddenGap& gap, const Contradicted& contradicted,
                    const std::vector<PlaceSigmas>& sigmas, std::vector<SceneState>& states);

}  // namespace hsi4d
