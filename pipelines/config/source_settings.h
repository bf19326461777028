// Config section `sources`: programs outside that make the video, the masks and the estimated motion of a run: an
// image-to-video model, a detector of people, a segmenter, a pose estimator. docs/services.md tells them what is
// expected of them.
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

/// Exit status by which a program says that it could not now and may be asked again (EX_TEMPFAIL of sysexits.h).
inline constexpr int kTryAgainStatus = 75;
/// Exit status by which a program says that it was asked wrongly: asking again will not help.
inline constexpr int kAskedWronglyStatus = 2;

/// After which failures a program is run again.
enum class RetryOn { kTemporary, kAny };

inline constexpr std::array<ConfigChoice<RetryOn>, 2> kRetryOns = {
    {{RetryOn::kTemporary, "temporary"}, {RetryOn::kAny, "any"}}};

/// A program that makes something.
struct ProgramSettings {
  std::vector<std::string> command;  ///< empty: none
  double timeout_s = 7200;           ///< of each time it is run; 0: as long as it takes
  int retries = 2;                   ///< how often it is run again after a failure
  double retry_wait_s = 10;          ///< before the first of them; twice as long before each of the others
  RetryOn retry_on = RetryOn::kTemporary;
};

/// The program that makes the video of the first frame.
struct VideoSourceSettings : ProgramSettings {
  VideoOutput output = VideoOutput::kMp4;
  Index frames = 0;  ///< that the video must have; 0: any number
};

/// Who makes masks or poses.
enum class SourceProgram { kCommand, kEmbedded };

inline constexpr std::array<ConfigChoice<SourceProgram>, 2> kSourcePrograms = {
    {{SourceProgram::kCommand, "command"}, {SourceProgram::kEmbedded, "embedded"}}};

/// A command, or this program.
struct OwnSourceSettings : ProgramSettings {
  SourceProgram program = SourceProgram::kCommand;

  bool is_embedded() const { return program == SourceProgram::kEmbedded; }
};

/// Config section `sources`.
struct SourceSettings {
  std::filesystem::path folder;  ///< of what was made; empty: "generated" beside the config
  std::string prompt;            ///< what happens in the video
  VideoSourceSettings video;
  OwnSourceSettings person;  ///< keypoints and masks of the human in the video; embedded: the front end finds them
  OwnSourceSettings masks;   ///< embedded: pipelines/follow makes those of the objects; the human's are known before
  OwnSourceSettings motion;  ///< poses of the human in the video; embedded: of its keypoints
};

/// Whether the human is looked for in the video: by sources.person or, where this program makes the motion and no
/// keypoints are given, by the front end.
bool finds_person(const SourceSettings& sources, const std::filesystem::path& keypoints);

/// The command that does: that of sources.person, else the front end's where it is installed beside this program, or in
/// the source tree that this program was built in. Empty: there is none.
std::vector<std::string> person_command(const SourceSettings& sources);

/// The files at which the front end is looked for.
std::vector<std::filesystem::path> front_end_places();

/// Whether a command, or this program, makes the masks.
bool makes_masks(const SourceSettings& sources);

/// Whether some program makes a part of the data.
bool has_sources(const SourceSettings& sources);

/// Describe the sections: every setting with its range.
void describe(ConfigFields& fields, VideoSourceSettings& settings);
void describe(ConfigFields& fields, SourceSettings& settings);

/// Settings of a program that its output does not depend on.
const std::vector<std::string>& settings_of_trying();

/// Placeholders that commands may have.
const std::vector<std::string>& video_placeholders();
const std::vector<std::string>& person_placeholders();
const std::vector<std::string>& mask_placeholders();
const std::vector<std::string>& motion_placeholders();

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
