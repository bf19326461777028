#include "pipelines/locate/picks.h"

#include <array>
#include <charconv>
#include <cmath>
#include <string_view>

#include "core/check.h"
#include "core/size_text.h"
#include "core/text.h"
#include "pipelines/draw/median_depth.h"

namespace hsi4d {

namespace {

constexpr std::string_view kOfPoints = "frame_x,frame_y,x,y,z", kOfView = "frame_x,frame_y,view_x,view_y";
constexpr double kLargestNumber = 1e9;

[[noreturn]] void refuse(const std::string& name, int line, const std::string& problem) {
  throw DataError(name + ": line " + std::to_string(line) + ": " + problem);
}

/// A line without its comment, blanks and the end that other systems write.
std::string bare(std::string_view line) {
  std::string text;
  for (const char c : line.substr(0, line.find('#'))) {
    if (c != ' ' && c != '\t' && c != '\r') text += c;
  }
  return text;
}

std::vector<double> numbers_of(const std::string& text, std::size_t count, const std::string& name, int line) {
  std::vector<double> numbers;
  const char *at = text.data(), *const end = at + text.size();
  while (numbers.size() < count) {
    double number = 0;
    const auto read = std::from_chars(at, end, number);
    if (read.ec != std::errc() || !(std::fabs(number) <= kLargestNumber)) break;
    numbers.push_back(number);
    at = read.ptr;
    if (at == end || *at != ',') break;
    ++at;
  }
  if (numbers.size() != count || at != end)
    refuse(name, line,
           "\"" + with_escapes(text.substr(0, 80)) + "\" is no pick; allowed: " + std::to_string(count) +
               " finite numbers apart by commas");
  return numbers;
}

Pick pick_of(const std::vector<double>& numbers, int line) {
  Pick pick{line, {numbers[0], numbers[1]}, {}, {}};
  if (numbers.size() == 5) {
    pick.point_world = Vector3<double>(numbers[2], numbers[3], numbers[4]);
  } else {
    pick.view_pixel = Vector2<double>(numbers[2], numbers[3]);
  }
  return pick;
}

bool is_in(const Vector2<double>& pixel, const Camera& camera) {
  return pixel[0] >= 0 && pixel[1] >= 0 && pixel[0] < camera.width && pixel[1] < camera.height;
}

std::string outside(const Vector2<double>& pixel, const char* what, const Camera& camera) {
  return number_text(pixel[0]) + "," + number_text(pixel[1]) + " is outside of the " + what + ", which has " +
         size_text(camera) + " pixels";
}

}  // namespace

std::vector<Pick> decode_picks(const std::string& text, const std::string& name) {
  std::vector<Pick> picks;
  std::size_t count = 0;  // numbers in a line, of the first line that is not empty
  int line = 0;
  for (std::size_t begin = 0; begin < text.size(); ++line) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string content = bare(std::string_view(text).substr(begin, end - begin));
    begin = end + 1;
    if (content.empty()) continue;
    if (count == 0) {
      if (content != kOfPoints && content != kOfView)
        refuse(name, line + 1,
               "\"" + with_escapes(content.substr(0, 80)) + "\" does not name what the lines hold; allowed: " +
                   std::string(kOfPoints) + " or " + std::string(kOfView));
      count = content == kOfPoints ? 5 : 4;
      continue;
    }
    const Pick pick = pick_of(numbers_of(content, count, name, line + 1), line + 1);
    for (const Pick& other : picks) {
      if (other.frame_pixel == pick.frame_pixel)
        refuse(name, pick.line, "picks the place in the frame that line " + std::to_string(other.line) + " picks");
    }
    picks.push_back(pick);
  }
  if (picks.empty())
    throw DataError(name + ": holds no picks; allowed: a line " + std::string(kOfPoints) + " or " +
                    std::string(kOfView) + ", then such numbers, a pick a line");
  return picks;
}

std::vector<PickedPoint> picked_points(const std::vector<Pick>& picks, const Gaussians& scene, const Camera& frame,
                                       const std::optional<SceneView>& view, const std::string& name) {
  const bool are_of_view = !picks.empty() && picks.front().view_pixel.has_value();
  if (are_of_view != view.has_value())
    throw UserError(name + (are_of_view ? ": picks places in another picture; whose camera is which? --view says it"
                                        : ": picks points of the scene; --view has no meaning for it"));
  std::vector<float> depths;
  if (are_of_view) depths = median_depths(scene, *view);
  std::string problems;
  const auto add_problem = [&](const Pick& pick, const std::string& problem) {
    problems += (problems.empty() ? "" : "\n") + name + ": line " + std::to_string(pick.line) + ": " + problem;
  };
  std::vector<PickedPoint> points;
  for (const Pick& pick : picks) {
    if (!is_in(pick.frame_pixel, frame)) add_problem(pick, outside(pick.frame_pixel, "frame", frame));
    if (!are_of_view) {
      points.push_back({pick.frame_pixel, *pick.point_world});
      continue;
    }
    const Camera& camera = view->camera;
    const Vector2<double>& pixel = *pick.view_pixel;
    if (!is_in(pixel, camera)) {
      add_problem(pick, outside(pixel, "view", camera));
      continue;
    }
    const auto at = static_cast<std::size_t>(pixel[1]) * static_cast<std::size_t>(camera.width) +
                    static_cast<std::size_t>(pixel[0]);
    const auto depth = static_cast<double>(depths[at]);
    if (!(depth > 0)) {
      add_problem(pick, "the view sees through the scene at " + number_text(pixel[0]) + "," + number_text(pixel[1]) +
                            ", so that no point is there");
      continue;
    }
    points.push_back(
        {pick.frame_pixel, transform_point(inverse(camera.camera_from_world), unproject_pixel(camera, pixel, depth))});
  }
  if (!problems.empty()) throw UserError(problems);
  return points;
}

}  // namespace hsi4d
