// What a stage of a run records on its tape before its loss: the graph, in its state, beside what it is compared with.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pipelines/graph/frame_graph.h"
#include "pipelines/graph/sequence_graph.h"
#include "pipelines/run/reconstruct_stage.h"

namespace hsi4d {

/// A frame on a tape, and what the losses of its stage read.
template <class S>
struct RecordedFrame {
  std::unique_ptr<FrameGraph<S>> graph;
  LossInputs<S> inputs;
};

/// Records a frame as a stage has it. What the task names has to outlive it; state and colours are read.
/// @param camera_reach  as FrameGraphSettings has it
template <class S>
RecordedFrame<S> record_frame(Tape<S>& tape, const StageTask& task, const FrameTask& frame, const SceneState& state,
                              const ColorState& colors, std::optional<double> camera_reach);

/// How far a stage can move each of the camera's six numbers.
double camera_reach_of(const StageSettings& stage);

/// Records the sequence as a stage has it.
template <class S>
SequenceGraph<S> record_sequence(Tape<S>& tape, const StageTask& task, const std::vector<SceneState>& states);

/// "interaction, frame 3": what messages call a stage of a frame.
std::string name_in_frame(const StageTask& task, const FrameTask& frame);

extern template RecordedFrame<float> record_frame(Tape<float>&, const StageTask&, const FrameTask&, const SceneState&,
                                                  const ColorState&, std::optional<double>);
extern template RecordedFrame<double> record_frame(Tape<double>&, const StageTask&, const FrameTask&, const SceneState&,
                                                   const ColorState&, std::optional<double>);
extern template SequenceGraph<float> record_sequence(Tape<float>&, const StageTask&, const std::vector<SceneState>&);
extern template SequenceGraph<double> record_sequence(Tape<double>&, const StageTask&, const std::vector<SceneState>&);

}  // namespace hsi4d
