#include "pipelines/run/stage_session.h"

#include <algorithm>
#include <cmath>

#include "core/suggest.h"
#include "core/text.h"
#include "pipelines/draw/frame_images.h"
#include "pipelines/run/frame_start.h"

namespace hsi4d {

namespace {

void check_fits(const SceneState& state, const Clip& clip, const std::string& name) {
  const auto check = [&name](Index found, Index wanted, const char* what) {
    if (found != wanted)
      throw UserError(name + ": a state of " + std::to_string(found) + " " + what + "; the clip has " +
                      std::to_string(wanted));
  };
  check(std::ssize(state.objects), std::ssize(clip.objects), "objects");
  check(std::ssize(state.others), std::ssize(clip.others), "people beside the first one");
  for (std::size_t p = 0; p < clip.people(); ++p)
    check(state.person(p).joints(), clip.first.person(p).joints(), "joints");
}

template <class S>
bool has_one_width(const ParameterGroup<S>& group) {
  return std::all_of(group.blocks.begin(), group.blocks.end(),
                     [&group](Var<S> block) { return block.shape().cols == group.blocks.front().shape().cols; });
}

/// Shape of the group's matrix, without numbers.
template <class S>
GroupNumbers<S> matrix_of(const ParameterGroup<S>& group) {
  GroupNumbers<S> matrix{group.name, 0, 0, {}};
  if (group.blocks.empty()) return matrix;
  Index count = 0;
  for (const Var<S> block : group.blocks) count += block.shape().count();
  matrix.cols = has_one_width(group) ? group.blocks.front().shape().cols : count;
  matrix.rows = matrix.cols > 0 ? count / matrix.cols : 0;
  return matrix;
}

}  // namespace

void set_states(StageInputs& inputs, const std::vector<SceneState>* before, const SceneState* start) {
  if (before != nullptr) {
    if (before->size() != inputs.before.size())
      throw UserError("before: " + std::to_string(before->size()) + " states; the stage follows " +
                      std::to_string(inputs.before.size()));
    for (std::size_t t = 0; t < before->size(); ++t)
      check_fits((*before)[t], inputs.clip, "before[" + std::to_string(t) + "]");
    inputs.before = *before;
    if (inputs.frame.value_or(0) > 0) inputs.start = frame_start(inputs.config.start, inputs.clip, inputs.before);
  }
  if (start == nullptr) return;
  if (!inputs.frame) throw UserError("start: the stage is over all frames at once; allowed: before, the states of all");
  check_fits(*start, inputs.clip, "start");
  inputs.start = *start;
}

template <class S>
StageSession<S>::StageSession(std::unique_ptr<const StageInputs> inputs)
    : inputs_(std::move(inputs)), colors_(inputs_->colors()) {
  const StageSettings& settings = inputs_->settings();
  if (inputs_->frame) {
    frame_ = record_frame<S>(tape_, inputs_->task(), inputs_->frame_task(), inputs_->start, colors_,
                             camera_reach_of(settings));
    loss_inputs_ = frame_->inputs;
    options_.name = name_in_frame(inputs_->task(), inputs_->frame_task());
    options_.kept = &colors_.moments;
    options_.held = frame_->graph->held();
  } else {
    sequence_.reset(new SequenceGraph<S>(record_sequence<S>(tape_, inputs_->task(), inputs_->before)));
    loss_inputs_ = sequence_->loss_inputs();
    options_.name = inputs_->name();
  }
  run_.emplace(tape_, settings, inputs_->losses, loss_inputs_, frame_ ? frame_->graph->groups() : sequence_->groups(),
               options_);
}

template <class S>
UserError StageSession<S>::refused(const std::string& text) const {
  return UserError("stage '" + options_.name + "': " + text);
}

template <class S>
template <class ValueOf>
std::vector<GroupNumbers<S>> StageSession<S>::numbers(const ValueOf& value_of) const {
  std::vector<GroupNumbers<S>> all;
  for (const OptimizerGroup<S>& group : run_->groups()) {
    GroupNumbers<S> matrix = matrix_of(group.parameters);
    for (const Var<S> block : group.parameters.blocks) {
      const ConstArray<S> values = value_of(block);
      for (Index r = 0; r < block.shape().planes * block.shape().rows; ++r) {
        if (values) {
          matrix.numbers.insert(matrix.numbers.end(), values.row(r), values.row(r) + values.shape.cols);
        } else {
          matrix.numbers.resize(matrix.numbers.size() + static_cast<std::size_t>(block.shape().cols));
        }
      }
    }
    all.push_back(std::move(matrix));
  }
  return all;
}

template <class S>
std::vector<GroupNumbers<S>> StageSession<S>::parameters() const {
  return numbers([this](Var<S> block) { return tape_.value(block); });
}

template <class S>
std::vector<GroupNumbers<S>> StageSession<S>::gradients() const {
  return numbers([this](Var<S> block) { return tape_.has_gradient(block) ? tape_.gradient(block) : ConstArray<S>(); });
}

/// The group that the numbers are of. Throws where they cannot be its own.
template <class S>
const ParameterGroup<S>& StageSession<S>::checked_group(const GroupNumbers<S>& numbers) const {
  std::vector<std::string> names;
  for (const OptimizerGroup<S>& group : run_->groups()) names.push_back(group.parameters.name);
  const auto found = std::find(names.begin(), names.end(), numbers.group);
  if (found == names.end())
    throw refused("it moves no group \"" + numbers.group + "\"" + did_you_mean(numbers.group, names) +
                  " (known: " + joined(names) + ")");
  const ParameterGroup<S>& group = run_->groups()[static_cast<std::size_t>(found - names.begin())].parameters;
  const GroupNumbers<S> matrix = matrix_of(group);
  if (numbers.rows != matrix.rows || numbers.cols != matrix.cols ||
      std::ssize(numbers.numbers) != numbers.rows * numbers.cols)
    throw refused(group.name + ": an array [" + std::to_string(numbers.rows) + "," + std::to_string(numbers.cols) +
                  "]; allowed: [" + std::to_string(matrix.rows) + "," + std::to_string(matrix.cols) + "]");
  std::size_t at = 0;
  for (std::size_t b = 0; b < group.blocks.size(); ++b) {
    const std::optional<ParameterRange> range = group.range_of(b);
    for (Index i = 0; i < group.blocks[b].shape().count(); ++i) {
      const S number = numbers.numbers[at++];
      const bool is_inside = !range || (number >= range->low && number <= range->high);
      if (std::isfinite(number) && is_inside) continue;
      throw refused(
          group.name + ": " + std::to_string(number) + "; allowed: " +
          (range ? number_text(range->low) + " to " + number_text(range->high) : std::string("finite numbers")));
    }
  }
  return group;
}

template <class S>
void StageSession<S>::set_parameters(const std::vector<GroupNumbers<S>>& groups) {
  std::vector<const ParameterGroup<S>*> known;
  for (const GroupNumbers<S>& numbers : groups) known.push_back(&checked_group(numbers));
  run_->parameters_were_written();
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const S* next = groups[g].numbers.data();
    for (const Var<S> block : known[g]->blocks) {
      const Index count = block.shape().count();
      tape_.set(block, std::span<const S>(next, static_cast<std::size_t>(count)));
      next += count;
    }
  }
}

template <class S>
SceneState StageSession<S>::state() const {
  if (!frame_) throw refused("it is over all frames at once, which have a state each");
  SceneState state = inputs_->start;
  frame_->graph->read_state(inputs_->settings().optimize, state);
  return state;
}

template <class S>
std::vector<SceneState> StageSession<S>::states() const {
  if (!sequence_) throw refused("it is of one frame, which has one state");
  std::vector<SceneState> states = inputs_->before;
  sequence_->read_states(inputs_->settings().optimize, states);
  return states;
}

template <class S>
Image StageSession<S>::image() {
  if (!frame_) throw refused("it is over all frames at once and draws no image");
  const Var<S> image = frame_->graph->rendered().image;
  tape_.forward(image);
  return to_image(tape_.value(image));
}

template class StageSession<float>;
template class StageSession<double>;

}  // namespace hsi4d
