// `hsi4d joint`: the hinge or slide that the poses of an object tell.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/angles.h"
#include "core/check.h"
#include "core/config_value.h"
#include "core/text.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/text.h"
#include "pipelines/input/joint_fit.h"
#include "pipelines/input/scene_setup.h"

namespace hsi4d::cli {

namespace {

struct JointArguments {
  std::string tracks, object, gaussians, parent, type = "hinge";
};

const std::string kJointCommand = "hsi4d joint: ";

ConfigValue axis_numbers(const Vector3<double>& v) {
  ConfigValue list = ConfigValue::make_array();
  for (Index i = 0; i < 3; ++i) list.items.push_back(ConfigValue::make_number(v[i]));
  return list;
}

ConfigValue joint_section(const JointArguments& a, const ObjectJoint& joint) {
  ConfigValue section = ConfigValue::make_object();
  section.add("type", ConfigValue::make_string(std::string(choice_name<JointType>(kJointTypes, joint.type))));
  if (!a.parent.empty()) section.add("parent", ConfigValue::make_string(a.parent));
  section.add("axis", axis_numbers(joint.axis));
  if (joint.type == JointType::kHinge) section.add("origin", axis_numbers(joint.origin));
  return section;
}

/// Of the object to its parent, by frame.
std::vector<Rigid<double>> joint_poses(const JointArguments& a) {
  std::vector<std::string> names = {a.object};
  if (!a.parent.empty()) names.push_back(a.parent);
  std::vector<Rigid<double>> poses;
  for (const std::vector<ObjectPose>& frame : read_object_tracks(a.tracks, names)) {
    const Rigid<double> parent = a.parent.empty() ? Rigid<double>() : rigid_of(frame[1]);
    poses.push_back(compose(inverse(parent), rigid_of(frame[0])));
  }
  if (poses.size() < 2) throw DataError(a.tracks + ": has one frame; a joint shows in two at least");
  return poses;
}

/// Returns what the command prints. Throws UserError for options and files, and as fit_joint; DataError as the readers.
std::string joint_command(const JointArguments& a) {
  const bool is_hinge = a.type == "hinge";
  if (!is_hinge && a.type != "slide")
    throw UserError(kJointCommand + "--type: \"" + a.type + "\" is not known; allowed: hinge, slide");
  if (a.parent == a.object) throw UserError(kJointCommand + "--parent: an object does not hang on itself");
  const JointFit found =
      fit_joint(is_hinge ? JointType::kHinge : JointType::kSlide, joint_poses(a), read_object(a.gaussians));
  const auto [low, high] = std::minmax_element(found.values.begin(), found.values.end());
  double squares = 0;
  for (const double distance : found.distances) squares += distance * distance;
  const auto shown = [is_hinge](double q) {
    return number_text(std::round(10 * (is_hinge ? q / kDegree : 1000 * q)) / 10 + 0.0);  // no -0
  };
  return to_json_line(joint_section(a, found.joint)) + "\n" + a.object + (is_hinge ? " turns" : " slides") + " from " +
         shown(*low) + " to " + shown(*high) + (is_hinge ? " degrees" : " mm") + "; its points are " +
         rounded(1000 * std::sqrt(squares / static_cast<double>(found.distances.size())), 3) +
         " mm from the poses (root mean square), in the worst frame " +
         rounded(1000 * *std::max_element(found.distances.begin(), found.distances.end()), 3) + "; for data.objects." +
         a.object + ".joint\n";
}

}  // namespace

void add_joint(CLI::App& app, Program& program) {
  JointArguments& a = program.options<JointArguments>();
  CLI::App& command = *app.add_subcommand("joint", "Find the hinge or slide that the poses of an object tell");
  command.add_option("OBJECTS", a.tracks, "Poses of objects: objects.npz of a run")->required();
  command.add_option("NAME", a.object, "The object")->required();
  command.add_option("--gaussians", a.gaussians, "Its Gaussians")->type_name("F.ply")->required();
  command.add_option("--type", a.type, "hinge or slide")->type_name("WORD");
  command.add_option("--parent", a.parent, "The object that it hangs on; without: the scene")->type_name("NAME");
  run_when_chosen(command, program, [&] { return joint_command(a); });
}

}  // namespace hsi4d::cli
