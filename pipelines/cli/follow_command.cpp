// `hsi4d follow`: the masks of objects in a video, from one click, box or mask of each in its first frame.
#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/config.h"
#include "core/folder_in_making.h"
#include "core/text.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/cli/text.h"
#include "pipelines/config/masks.h"
#include "pipelines/follow/follow.h"

namespace hsi4d::cli {

namespace {

struct FollowArguments {
  std::string video, masks, out;
  std::vector<std::string> objects;  ///< NAME=X,Y; NAME=X0,Y0,X1,Y1; NAME=FILE
  std::optional<double> video_rate, frame_rate;
  std::optional<int> longest_side_px;
  bool quiet = false;
};

const std::string kFollowCommand = "hsi4d follow: ";

/// Whether a text is numbers and commas, rather than the name of a file.
bool are_numbers(const std::string& text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) {
    return (c >= '0' && c <= '9') || c == ',' || c == '.' || c == '-' || c == '+';
  }) && text.find(',') != std::string::npos;
}

/// Adds what "NAME=..." says to what is known of the object.
void add_hint(ConfigMap<ObjectHint>& hints, const std::string& text) {
  const std::size_t equals = text.find('=');
  const std::string allowed =
      "allowed: NAME=X,Y (several of them are several clicks), NAME=X0,Y0,X1,Y1 or NAME=MASK.png";
  if (equals == std::string::npos || equals == 0 || equals + 1 == text.size())
    throw UserError(kFollowCommand + "--object: \"" + with_escapes(text) + "\" is no object; " + allowed);
  const std::string name = text.substr(0, equals), value = text.substr(equals + 1);
  if (!is_file_name(name))
    throw UserError(kFollowCommand + "--object: " + with_escapes(name) + " is no name of a file or folder");
  if (name == kHumanMasks)
    throw UserError(kFollowCommand + "--object: " + name + " is the folder of the human's masks; use another name");
  auto at = std::find_if(hints.begin(), hints.end(), [&name](const auto& entry) { return entry.first == name; });
  if (at == hints.end()) {
    hints.emplace_back(name, ObjectHint{});
    at = hints.end() - 1;
  }
  ObjectHint& hint = at->second;
  const std::string option = kFollowCommand + "--object " + name;
  const bool is_click = are_numbers(value) && std::count(value.begin(), value.end(), ',') == 1;
  if (!hint.empty() && !(is_click && !hint.clicks.empty()))
    throw UserError(option + ": given twice; allowed: several clicks, or one box or mask");
  if (is_click) {
    const std::vector<double> n = parse_numbers(value, 2, option, "X,Y");
    hint.clicks.push_back({n[0], n[1]});
  } else if (are_numbers(value)) {
    hint.box = parse_numbers(value, 4, option, "X,Y or X0,Y0,X1,Y1");
  } else {
    hint.mask = value;
  }
}

std::vector<ObjectToFollow> first_masks_of(const FollowArguments& a, const FrameSource& frames, const Image& human,
                                           int side) {
  ConfigMap<ObjectHint> hints;
  for (const std::string& text : a.objects) add_hint(hints, text);
  const Image frame = read_rgb(frames, 0);
  std::vector<ObjectToFollow> objects;
  for (const auto& [name, hint] : hints)
    objects.push_back({name, first_mask(hint, frame, human, side, kFollowCommand + "--object " + name)});
  return objects;
}

/// Writes the masks. Returns what the command prints.
/// Throws UserError for options; as FrameSource, MaskSource, first_mask and follow_objects.
std::string follow_command(const FollowArguments& a) {
  check_rate(a.video_rate, kFollowCommand + "--video-rate");
  check_rate(a.frame_rate, kFollowCommand + "--frame-rate");
  const int side = a.longest_side_px.value_or(kFollowSide);
  if (side < 64 || side > 4096)
    throw UserError(kFollowCommand + "--longest-side-px: " + std::to_string(side) +
                    " is out of range; allowed: 64 to 4096");
  const FrameSource frames(a.video, {a.video_rate.value_or(0), a.frame_rate.value_or(0)});
  std::optional<MaskSource> human;
  if (!a.masks.empty()) human.emplace(a.masks, kHumanMasks);
  const InterruptWatch watch;
  FolderInMaking out(a.out);
  const std::vector<ObjectToFollow> objects = first_masks_of(a, frames, human_mask(human, frames, 0), side);
  const std::vector<FollowedTrack> tracks = follow_objects(
      frames, human, objects, side, [&out](const std::filesystem::path& file) { return out.file(file); },
      observer_on_terminal(a.quiet));
  out.commit();
  std::string text;
  for (const FollowedTrack& track : tracks) text += track_text(track, frames) + "\n";
  return text + (std::filesystem::path(a.out) / kSheetFile).generic_string() + " shows them\n";
}

}  // namespace

void add_follow(CLI::App& app, Program& program) {
  FollowArguments& a = program.options<FollowArguments>();
  CLI::App& command = *app.add_subcommand(
      "follow", "Masks of objects in all frames of a video, from a click, box or mask of each in the first");
  command.add_option("VIDEO", a.video, "A video, or a folder of frames")->required();
  add_several(command, "--object", a.objects,
              "An object and where it is in the first frame: a pixel on it (give several for a part each), a box "
              "around it, or its mask")
      ->type_name("NAME=X,Y|X0,Y0,X1,Y1|F.png")
      ->required();
  command.add_option("--masks", a.masks, "A folder with human/, as for data.masks: who may hide the objects")
      ->type_name("DIR");
  command.add_option("--video-rate", a.video_rate, "Frames a second of the video; only where --frame-rate needs it")
      ->type_name("HZ");
  command.add_option("--frame-rate", a.frame_rate, "Frames a second that are kept; default: all")->type_name("HZ");
  command.add_option("--longest-side-px", a.longest_side_px, "Of the pictures that are looked at; default: 512")
      ->type_name("N");
  command.add_option("--out", a.out, "Where to: a new or empty folder")->type_name("DIR")->required();
  command.add_flag("--quiet", a.quiet, "No progress on stderr");
  run_when_chosen(command, program, [&] { return follow_command(a); });
}

}  // namespace hsi4d::cli
