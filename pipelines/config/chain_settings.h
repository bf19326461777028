// Config section `chain`: clips that follow one another, each from where the one before ended.   [method.md, §6]
#pragma once

#include <string>
#include <vector>

#include "core/config.h"
#include "pipelines/config/data_settings.h"
#include "pipelines/config/source_settings.h"

namespace hsi4d {

/// A clip of a chain.
struct ChainClip {
  std::string name;    ///< of its run folder too
  std::string prompt;  ///< what happens in its video; empty: as sources.prompt
  bool select_camera =
      false;          ///< its camera is chosen in its first state, with the size and focal lengths of data.camera
  DataSettings data;  ///< what is written, laid over the config's own by lay_over_data
};

/// Describes the section: every setting with its range.
void describe(ConfigFields& fields, ChainClip& clip);

/// Fills in what the clips share: their `data` becomes that of the whole config with their own laid over it. The state
/// of frame 0 and the truth are of one clip: those of the config are the first clip's alone.
/// @param tree  the config, in which everything that is written was found right
void lay_over_data(const ConfigValue& tree, std::vector<ChainClip>& chain, ConfigProblems& problems);

/// Whether the config, a tree, has a clip whose camera is chosen: section `camera_selection` then decides the result.
bool selects_camera(const ConfigValue& tree);

/// The programs that make what the clip's data do not name, with its prompt.
SourceSettings sources_of(const SourceSettings& shared, const ChainClip& clip);

}  // namespace hsi4d
