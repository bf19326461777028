// Config section `sources`: programs outside that make the video and the masks of a run, an image-to-video model and a
// segmenter.
//
// A command is a list of arguments, the program first; no shell reads them. In any argument stand for themselves all
// characters but placeholders, {word}, which are replaced; {{word}} is {word}.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/config.h"
#include "core/types.h"

namespace hsi4d {

/// What a program writes as the video.
enum class VideoOutput { kMp4, kMov, kMkv, kWebm, kFrames };

inline constexpr std::array<ConfigChoice<VideoOutput>, 5> kVideoOutputs = {{{VideoOutput::kMp4, "mp4"},
                                                                            {VideoOutput::kMov, "mov"},
                                                                            {VideoOutput::kMkv, "mkv"},
                                                                            {VideoOutput::kWebm, "webm"},
                                                                            {VideoOutput::kFrames, "frames"}}};

/// The program that makes the video of the first frame.
struct VideoSourceSettings {
  std::vector<std::string> command;  ///< empty: none
  double timeout_s = 7200;           ///< 0: as long as it takes
  VideoOutput output = VideoOutput::kMp4;
  Index frames = 0;  ///< that the video must have; 0: any number
};

/// The program that makes the masks of the video.
struct MaskSourceSettings {
  std::vector<std::string> command;  ///< empty: none
  double timeout_s = 7200;           ///< 0: as long as it takes
};

/// Config section `sources`.
struct SourceSettings {
  std::filesystem::path folder;  ///< of what was made; empty: "generated" beside the config
  std::string prompt;            ///< what happens in the video
  VideoSourceSettings video;
  MaskSourceSettings masks;
};

/// Whether some program makes a part of the data.
bool has_sources(const SourceSettings& sources);

/// Describe the sections: every setting with its range.
void describe(ConfigFields& fields, VideoSourceSettings& settings);
void describe(ConfigFields& fields, MaskSourceSettings& settings);
void describe(ConfigFields& fields, SourceSettings& settings);

/// Placeholders that commands may have.
const std::vector<std::string>& video_placeholders();
const std::vector<std::string>& mask_placeholders();

/// The placeholders of an argument, without braces, in order.
std::vector<std::string> placeholders_in(const std::string& argument);

/// Whether some argument has the placeholder.
bool uses_placeholder(const std::vector<std::string>& command, const std::string& name);

/// The command with what stands for its placeholders. Throws InternalError for one without a value.
std::vector<std::string> filled_in(const std::vector<std::string>& command,
                                   const std::map<std::string, std::string>& values);

/// What is wrong with a command.
struct CommandFault {
  std::string pointer;  ///< within the command's section: "/command/2"
  std::string text;
};

/// Placeholders that are not known, {out} or the program missing, a program that is not there.
std::vector<CommandFault> command_faults(const std::vector<std::string>& command,
                                         const std::vector<std::string>& known);

}  // namespace hsi4d
