#include "pipelines/config/removed_keys.h"

#include <array>
#include <string>

namespace hsi4d {
namespace {

struct RemovedKey {
  const char* path;     ///< JSON pointer; * is any name
  const char* since;    ///< the version that has it no more
  const char* is_now;   ///< the value that the program has, as JSON on one line
  const char* instead;  ///< what replaces it
};

constexpr auto kRemovedKeys = std::to_array<RemovedKey>({
    {"/approx/camera_pixel_share", "0.1.0", "1", "every pixel counts; approx.longest_side_px reduces images"},
    {"/approx/collapse_suffix", "0.1.0", "false", "skip.static_layer leaves out what costs most, and is exact"},
    {"/camera_selection/at_objects", "0.1.0", "true", "candidates look between the human and what it faces"},
    {"/camera_selection/azimuths", "0.1.0", "24", "24 directions are tried"},
    {"/camera_selection/elevations_deg", "0.1.0", "[0, 15, 30]", "0, 15 and 30 degrees above the horizon are tried"},
    {"/camera_selection/trial_px", "0.1.0", "256", "joints are counted in images of 256 px"},
    {"/color_net/pose_gradient", "0.1.0", "true", "colours have a gradient in the pose"},
    {"/stages/*/longest_side_px", "0.1.0", "0", "approx.longest_side_px reduces the images of all stages"},
    {"/stages/*/losses/penetration/memory_mib", "0.1.0", "256", "at most 256 MiB are taken; a larger cell takes less"},
    {"/stages/*/optimizer/products", "0.1.0", "10", "gauss_newton, which had it, lost to adam and bfgs"},
    {"/stages/*/plateau", "0.1.0", "{\"iterations\": 0, \"gain\": 0.01}", "a stage ends after its iterations"},
});

/// A pointer as the table has it: names of stages as *, the one stage of an avatar's fit too.
std::string general(const std::string& pointer) {
  const auto with_star = [&pointer](std::size_t begin) {
    const std::size_t end = pointer.find('/', begin);
    return "/stages/*" + (end == std::string::npos ? "" : pointer.substr(end));
  };
  if (pointer.starts_with("/stage/")) return with_star(1);
  return pointer.starts_with("/stages/") ? with_star(8) : pointer;
}

void take_removed(ConfigValue& object, const std::string& pointer, ConfigProblems& problems) {
  std::erase_if(object.members, [&](const ConfigMember& member) {
    const std::string here = child_pointer(pointer, member.key);
    for (const RemovedKey& removed : kRemovedKeys) {
      if (general(here) != removed.path) continue;
      if (to_json_line(member.value) != removed.is_now)
        problems.add(member.key_origin, here,
                     std::string("no setting since ") + removed.since + ": " + removed.instead);
      return true;
    }
    return false;
  });
  for (ConfigMember& member : object.members) take_removed(member.value, child_pointer(pointer, member.key), problems);
}

}  // namespace

ConfigValue without_removed_keys(ConfigValue tree, ConfigProblems& problems) {
  take_removed(tree, "", problems);
  return tree;
}

}  // namespace hsi4d
