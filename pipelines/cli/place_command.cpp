// `hsi4d place`: the state of frame 0, by saying where person and objects stand.
#include <algorithm>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/config_value.h"
#include "core/folder_in_making.h"
#include "core/text.h"
#include "pipelines/cli/first_state.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/text.h"
#include "pipelines/draw/standing.h"
#include "pipelines/input/body_files.h"
#include "pipelines/input/scene_setup.h"

namespace hsi4d::cli {

namespace {

struct PlaceArguments {
  std::string avatar, at, out;
  std::vector<std::string> objects;  ///< NAME=FILE,x,y,heading[,ground]
  double frame_rate = 10;            ///< of the motion, which has one frame
};

const std::string kPlaceCommand = "hsi4d place: ";

/// "x,y,heading" or "x,y,heading,ground".
StandingPlace parse_place(const std::string& text, const std::string& option) {
  const auto commas = static_cast<std::size_t>(std::count(text.begin(), text.end(), ','));
  const bool has_ground = commas == 3;
  const std::vector<double> n = parse_numbers(text, has_ground ? 4 : 3, kPlaceCommand + option,
                                              has_ground ? "x,y,heading,z" : "x,y,heading, or x,y,heading,z");
  return {n[0], n[1], n[2], has_ground ? n[3] : 0.0};
}

/// An object and where it stands.
struct PlacedObject {
  std::string name;
  std::filesystem::path file;
  StandingPlace place;
};

PlacedObject parse_object(const std::string& text) {
  const std::size_t equals = text.find('='), comma = text.find(',', equals);
  if (equals == std::string::npos || comma == std::string::npos || equals == 0)
    throw UserError(kPlaceCommand + "--object: \"" + text +
                    "\" is no object; allowed: NAME=FILE,x,y,heading, or with the "
                    "ground's height behind: NAME=FILE,x,y,heading,z");
  PlacedObject object{text.substr(0, equals), text.substr(equals + 1, comma - equals - 1), {}};
  if (!is_file_name(object.name))
    throw UserError(kPlaceCommand + "--object: " + with_escapes(object.name) + " is no name of a file or folder");
  object.place = parse_place(text.substr(comma + 1), "--object " + object.name);
  return object;
}

ConfigValue vector_value(const Vector3<double>& vector) {
  ConfigValue value = ConfigValue::make_array();
  for (Index i = 0; i < 3; ++i) value.items.push_back(ConfigValue::make_number(vector[i]));
  return value;
}

ConfigValue poses_of(const std::vector<PlacedObject>& objects) {
  ConfigValue poses = ConfigValue::make_object();
  for (const PlacedObject& object : objects) {
    const ObjectPose pose = standing_object(read_object(object.file), object.place);
    ConfigValue value = ConfigValue::make_object();
    value.add("rotation", vector_value(pose.rotation));
    value.add("translation", vector_value(pose.translation));
    poses.add(object.name, std::move(value));
  }
  return poses;
}

/// Writes initial.json and initial_motion.npz. Returns what the command prints.
/// Throws UserError for options and files; DataError as their readers.
std::string place_command(const PlaceArguments& a) {
  std::vector<PlacedObject> objects;
  std::set<std::string> names;
  for (const std::string& text : a.objects) {
    objects.push_back(parse_object(text));
    if (!names.insert(objects.back().name).second)
      throw UserError(kPlaceCommand + "--object: two are called " + objects.back().name);
  }
  check_rate(a.frame_rate, kPlaceCommand + "--frame-rate");
  const StandingPlace place = parse_place(a.at, "--at");
  const Avatar avatar = read_person(a.avatar);
  FolderInMaking out(a.out);
  write_first_state(out, avatar, place, a.frame_rate, poses_of(objects));
  out.commit();
  return (std::filesystem::path(a.out) / "initial.json").generic_string() + ": a person at " + short_number(place.x) +
         ", " + short_number(place.y) + " m" +
         (objects.empty() ? "" : ", " + count_text(std::ssize(objects), "object")) + "; for data.initial\n";
}

}  // namespace

void add_place(CLI::App& app, Program& program) {
  PlaceArguments& a = program.options<PlaceArguments>();
  CLI::App& command =
      *app.add_subcommand("place", "Write the state of frame 0: where a person and objects stand on the ground");
  command.add_option("--avatar", a.avatar, "Gaussians of the person")->type_name("F.safetensors")->required();
  command
      .add_option("--at", a.at,
                  "Where the person stands, metres, the way they look, degrees from +x to +y, and the ground's z, 0 "
                  "without")
      ->type_name("x,y,heading[,z]")
      ->required();
  add_several(command, "--object", a.objects, "An object and where it stands, likewise")
      ->type_name("NAME=F,x,y,heading[,z]");
  command.add_option("--frame-rate", a.frame_rate, "Of the motion, which has one frame")->type_name("HZ");
  command.add_option("--out", a.out, "Where to: a new or empty folder")->type_name("DIR")->required();
  run_when_chosen(command, program, [&] { return place_command(a); });
}

}  // namespace hsi4d::cli
