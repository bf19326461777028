#include "pipelines/config/source_settings.h"

#include <algorithm>
#include <functional>

#include "core/check.h"
#include "core/process.h"
#include "core/suggest.h"
#include "core/text.h"

namespace hsi4d {

namespace {

constexpr double kLongestTimeout = 7 * 24 * 3600.0;  // seconds
constexpr int kMostRetries = 100;

/// "{first_frame}, {prompt}".
std::string in_braces(const std::vector<std::string>& names) {
  std::vector<std::string> words;
  for (const std::string& name : names) words.push_back("{" + name + "}");
  return joined(words);
}

bool is_of_word(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}

/// Length of "{word}" at `at`, or 0.
std::size_t placeholder_at(const std::string& text, std::size_t at) {
  if (at >= text.size() || text[at] != '{') return 0;
  std::size_t end = at + 1;
  while (end < text.size() && is_of_word(text[end])) ++end;
  return end > at + 1 && end < text.size() && text[end] == '}' ? end + 1 - at : 0;
}

/// The argument with each placeholder replaced, {{word}} by {word}.
std::string replaced(const std::string& argument, const std::function<std::string(const std::string&)>& value_of) {
  std::string text;
  for (std::size_t at = 0; at < argument.size();) {
    const std::size_t doubled = argument[at] == '{' ? placeholder_at(argument, at + 1) : 0;
    if (doubled > 0 && at + 1 + doubled < argument.size() && argument[at + 1 + doubled] == '}') {
      text += argument.substr(at + 1, doubled);
      at += doubled + 2;
      continue;
    }
    const std::size_t length = placeholder_at(argument, at);
    text += length > 0 ? value_of(argument.substr(at + 1, length - 2)) : argument.substr(at, 1);
    at += std::max<std::size_t>(length, 1);
  }
  return text;
}

void describe_program(ConfigFields& f, ProgramSettings& s, const std::vector<std::string>& known) {
  f.strings(
      "command", s.command,
      "Program and arguments, without a shell; placeholders: " + in_braces(known) + "; empty: the files of `data`");
  f.number("timeout_s", s.timeout_s, {.min = 0, .max = kLongestTimeout},
           "Seconds after which the program is ended; 0: never");
  f.integer("retries", s.retries, {.min = 0, .max = kMostRetries}, "How often it is run again after a failure");
  f.number("retry_wait_s", s.retry_wait_s, {.min = 0, .max = kLongestTimeout},
           "Seconds before the first retry; doubles each time, to an hour at most");
  f.choice("retry_on", s.retry_on, kRetryOns,
           "Failures that are retried: exit status " + std::to_string(kTryAgainStatus) +
               " (temporary); any: also statuses other than " + std::to_string(kAskedWronglyStatus) +
               ", signals, timeouts, missing output");
}

}  // namespace

bool makes_masks(const SourceSettings& sources) {
  return sources.masks.is_embedded() || !sources.masks.command.empty();
}

bool has_sources(const SourceSettings& sources) {
  return !sources.video.command.empty() || sources.person.is_embedded() || !sources.person.command.empty() ||
         makes_masks(sources) || sources.motion.is_embedded() || !sources.motion.command.empty();
}

bool finds_person(const SourceSettings& sources, const std::filesystem::path& keypoints) {
  return keypoints.empty() &&
         (sources.person.is_embedded() || !sources.person.command.empty() || sources.motion.is_embedded());
}

std::vector<std::filesystem::path> front_end_places() {
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error) return {};
  std::vector<std::filesystem::path> places;
  for (const char* from_bin : {"../share/hsi4d/tools/frontend", "../../../tools/frontend"})
    places.push_back((program.parent_path() / from_bin).lexically_normal());
  return places;
}

std::vector<std::string> person_command(const SourceSettings& sources) {
  if (!sources.person.command.empty()) return sources.person.command;
  for (const std::filesystem::path& file : front_end_places()) {
    if (!find_program(file.string()).empty()) return {file.string(), "--no-install", "{video}", "--out", "{out}"};
  }
  return {};
}

void describe(ConfigFields& f, VideoSourceSettings& s) {
  describe_program(f, s, video_placeholders());
  f.choice("output", s.output, kVideoOutputs,
           "What {out} is: a video file with this ending, or a folder of .png files (frames)");
  f.integer("frames", s.frames, {.min = 0, .max = 1000000}, "Frames that the video must have; 0: any number");
}

void describe(ConfigFields& f, SourceSettings& s) {
  f.path("folder", s.folder, {}, "Where videos, masks and motions are kept; empty: generated/ beside the config");
  f.string("prompt", s.prompt, "What happens in the video: {prompt}");
  f.object("video", s.video, "The program that makes the video of an image and a text");
  f.object(
      "person", s.person, "The program that finds the human in the video: keypoints, and masks where no other has them",
      [](ConfigFields& fields, OwnSourceSettings& person) {
        describe_program(fields, person, person_placeholders());
        fields.choice("program", person.program, kSourcePrograms,
                      "Who finds him: `command`, or tools/frontend (embedded), which without a command does so for an "
                      "embedded motion too");
      });
  f.object("masks", s.masks, "The program that makes the masks of the video",
           [](ConfigFields& fields, OwnSourceSettings& masks) {
             describe_program(fields, masks, mask_placeholders());
             fields.choice("program", masks.program, kSourcePrograms,
                           "Who makes them: `command`, or hsi4d itself, from frame 0 on (embedded); data.masks, if "
                           "given, then has the human's, else what finds the person");
           });
  f.object("motion", s.motion, "The program that estimates the human's poses in the video",
           [](ConfigFields& fields, OwnSourceSettings& motion) {
             describe_program(fields, motion, motion_placeholders());
             fields.choice("program", motion.program, kSourcePrograms,
                           "Who estimates them: `command`, or hsi4d itself, from keypoints (embedded): those of "
                           "data.keypoints, if given, else what finds the person");
           });
}

const std::vector<std::string>& video_placeholders() {
  static const std::vector<std::string> names = {"first_frame", "prompt", "seed", "out"};
  return names;
}

const std::vector<std::string>& person_placeholders() {
  static const std::vector<std::string> names = {"video", "out"};
  return names;
}

const std::vector<std::string>& mask_placeholders() {
  static const std::vector<std::string> names = {"video", "objects", "first_masks", "prompt", "seed", "out"};
  return names;
}

const std::vector<std::string>& motion_placeholders() {
  static const std::vector<std::string> names = {"video", "video_rate", "camera", "prompt", "seed", "out"};
  return names;
}

const std::vector<std::string>& settings_of_trying() {
  static const std::vector<std::string> names = {"timeout_s", "retries", "retry_wait_s", "retry_on"};
  return names;
}

std::vector<std::string> placeholders_in(const std::string& argument) {
  std::vector<std::string> names;
  replaced(argument, [&names](const std::string& name) {
    names.push_back(name);
    return std::string();
  });
  return names;
}

bool uses_placeholder(const std::vector<std::string>& command, const std::string& name) {
  return std::any_of(command.begin(), command.end(), [&name](const std::string& argument) {
    const std::vector<std::string> names = placeholders_in(argument);
    return std::find(names.begin(), names.end(), name) != names.end();
  });
}

std::vector<std::string> filled_in(const std::vector<std::string>& command,
                                   const std::map<std::string, std::string>& values) {
  std::vector<std::string> filled;
  for (const std::string& argument : command) {
    filled.push_back(replaced(argument, [&values](const std::string& name) {
      const auto at = values.find(name);
      HSI4D_CHECK(at != values.end(), "nothing is known to put in the place of {" + name + "}");
      return at->second;
    }));
  }
  return filled;
}

std::vector<CommandFault> command_faults(const std::vector<std::string>& command,
                                         const std::vector<std::string>& known) {
  std::vector<CommandFault> faults;
  if (command.empty()) return faults;
  for (std::size_t i = 0; i < command.size(); ++i) {
    for (const std::string& name : placeholders_in(command[i])) {
      if (std::find(known.begin(), known.end(), name) != known.end()) continue;
      const std::string hint = did_you_mean(name, known);
      faults.push_back({"/command/" + std::to_string(i), "there is no placeholder {" + name +
                                                             "}; known here: " + in_braces(known) + hint + "; {{" +
                                                             name + "}} is that text"});
    }
  }
  if (!uses_placeholder(command, "out"))
    faults.push_back({"/command", "{out} is missing: the program has to be told where to write"});
  if (find_program(command.front()).empty())
    faults.push_back({"/command/0", "there is no program \"" + with_escapes(command.front()) +
                                        "\" that can be executed" +
                                        (command.front().find('/') == std::string::npos ? " in PATH" : "")});
  return faults;
}

}  // namespace hsi4d
