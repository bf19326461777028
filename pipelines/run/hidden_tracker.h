// Keeps track of the objects of a run through frames that hide them (hidden_objects.h).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "pipelines/config/run_config.h"
#include "pipelines/input/clip.h"
#include "pipelines/input/color_state.h"
#include "pipelines/input/state.h"
#include "pipelines/run/hidden_path.h"

namespace hsi4d {

/// Follows objects where `start.objects` is "best": what the best start is asked of can be seen, what cannot goes with
/// its carrier. Objects on joints stay on these, whatever shows of them.
class HiddenTracker {
 public:
  /// A frame of a pass.
  struct At {
    Index frame = 0;
    int pass = 1;
  };

  /// @param seen  [frame][object] the share that a frame shows, of the frames that have begun; start_hidden appends to
  /// it
  /// @param note  told what was done with an object, for the log
  HiddenTracker(const RunConfig& config, const Clip& clip, std::vector<std::vector<double>>& seen,
                std::function<void(const std::string&)> note);

  bool is_on() const;

  /// The shares of a frame that shows all.
  std::vector<double> all_seen() const;

  /// Notes what the frame shows of the objects, lets those that it hides go with their carriers, and looks for those
  /// that it shows again.
  /// @param done  states of the frames before
  void start_hidden(Index index, const ClipFrame& frame, const std::vector<SceneState>& done, const ColorState& colors,
                    SceneState& state);

  /// Whatever stages made of objects that the frame hides, these go with their carriers, in the light that they had.
  /// @param known  states by frame: those before, or, of a later pass, of all as the stages before it left them
  void carry_hidden(Index index, const std::vector<SceneState>& known, SceneState& state) const;

  /// Objects that the frame shows elsewhere are looked for from where the frame before has them now, and from the next
  /// frame that shows them.
  /// @param known  states by frame, as the stages before the pass left them
  void look_for_lost(At at, const ClipFrame& frame, const std::vector<SceneState>& known, const SceneState& before,
                     const ColorState& colors, SceneState& state) const;

  /// Between two frames that show it a hidden object is on a smooth path (hidden_path.h).
  /// @param sigmas  by frame; none: hidden objects go with the chest or stay, whatever frames say
  /// @param states  of all frames
  void lay_hidden(const ColorState& colors, const std::vector<PlaceSigmas>& sigmas,
                  std::vector<SceneState>& states) const;

 private:
  bool is_hidden(Index frame, std::size_t object) const;
  /// Whether what is drawn of it covers its mask: a frame that shows a sliver may leave it anywhere.
  bool is_where_shown(std::size_t object, Index frame, const SceneState& state, const ColorState& colors) const;
  /// The frames between `last` and `next`, and up to four at each side that do not have the object where it shows.
  /// @param least  the first frame that may begin it
  HiddenGap gap_around(std::size_t object, Index least, Index last, Index next, const ColorState& colors,
                       const std::vector<SceneState>& states) const;
  Index last_seen(Index before, std::size_t object) const;
  std::vector<const SceneState*> frames_with(std::size_t object, Index last,
                                             const std::vector<SceneState>& states) const;

  const RunConfig& config_;
  const Clip& clip_;
  std::vector<std::vector<double>>& seen_;
  std::function<void(const std::string&)> note_;
};

}  // namespace hsi4d
