#include "optim/stage_loss.h"

#include <memory>

#include <catch2/catch.hpp>

#include "autodiff/reduce.h"
#include "tests/support/test_motion.h"

namespace stage_loss_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// Which of two people a term is idle for.
struct Idle {
  static inline bool first = false, other = false;
};

/// A term of the body that tells whether it is idle.
LossTerm telling_loss() {
  return needing({LossInput::kMotion}, make_loss_term("telling", "A sum, told of", [](const auto& in) {
                   const bool is_idle = in.is_of_other ? Idle::other : Idle::first;
                   if (in.notes != nullptr) in.notes->push_back({"telling", "looked", is_idle, is_idle});
                   return sum(in.joints);
                 }));
}

std::vector<LossNote> notes_of_two(bool first, bool other) {
  Idle::first = first;
  Idle::other = other;
  Tape<double> tape;
  LossInputs<double> inputs;
  inputs.motion = std::shared_ptr<const MotionStart>(&motion_of_test().start, [](const MotionStart*) {});
  inputs.joints = tape.parameter("joints", shape_of(kFrames, 66));
  inputs.others = {inputs};
  inputs.others[0].is_of_other = true;
  StageSettings settings;
  settings.losses = {{"telling", {}}};
  return record_loss<double>(settings, std::vector{telling_loss()}, inputs, "some").notes;
}

}  // namespace

TEST_CASE("a term is idle where it is so for everybody, and tells whose note it is") {
  for (const auto& [first, other] : {std::pair{true, true}, {true, false}, {false, true}, {false, false}}) {
    INFO(first << " " << other);
    const std::vector<LossNote> notes = notes_of_two(first, other);
    REQUIRE(notes.size() == 2);
    CHECK(notes[0].text == "person 1: looked");
    CHECK(notes[1].text == "person 2: looked");
    for (const LossNote& note : notes) {
      CHECK(note.is_idle == (first && other));
      CHECK(note.is_of_clip == (first && other));
    }
  }
}

}  // namespace stage_loss_test
