#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "bench/scaling.h"
#include "core/check.h"
#include "core/suggest.h"
#include "core/text.h"

namespace hsi4d {

namespace {

// --- axes
// -------------------------------------------------------------------------------------------------------------

[[noreturn]] void refuse(const std::string& word, const std::string& text) {
  throw UserError("hsi4d bench scaling: --axis " + word + ": " + text);
}

/// "1000,2000".
std::vector<Index> numbers_in(const std::string& list, const std::string& word) {
  std::vector<Index> numbers;
  for (std::size_t begin = 0; begin <= list.size();) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    Index number = 0;
    const auto [rest, error] = std::from_chars(list.data() + begin, list.data() + end, number);
    if (error != std::errc() || rest != list.data() + end || number < 1)
      refuse(word, "\"" + list.substr(begin, end - begin) +
                       "\" is no number of 1 or more; write whole numbers apart by "
                       "commas: scene=100000,500000");
    numbers.push_back(number);
    begin = end + 1;
  }
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  return numbers;
}

const ScalingAxis& axis_named(const std::string& name, const std::string& word) {
  std::vector<std::string> known;
  for (const ScalingAxis& axis : scaling_axes()) {
    if (axis.name == name) return axis;
    known.push_back(axis.name);
  }
  refuse(word, "there is no axis \"" + name + "\"; known: " + joined(known) + did_you_mean(name, known));
}

// --- growth
// -----------------------------------------------------------------------------------------------------------

/// What was expected before anything was measured (docs/numerics/speed.md).
struct Expectation {
  const char* axis;
  const char* quantity;
  bool draws_all;
  double exponent;
  const char* reason;
};
constexpr std::array<Expectation, 26> kExpectations = {{
    {"scene", "least ms", false, 0.7, "records, projection, colours of each; the pixels' part stays"},
    {"scene", "pairs", false, 0.9, "most Gaussians are smaller than a tile and reach one"},
    {"scene", "fragments", false, 0.2, "the same surfaces; footprints end at the blur of half a pixel"},
    {"scene", "least ms", true, 0.2, "what stands is kept; what of it is seen beside what moves is composited"},
    {"scene", "pairs", true, 0.4, "those of what moves stay, those behind it grow"},
    {"scene", "fragments", true, 0.1, "the same surfaces behind the same human"},
    {"avatar", "least ms", false, 0, "it is not drawn"},
    {"avatar", "pairs", false, 0, "it is not drawn"},
    {"avatar", "fragments", false, 0, "it is not drawn"},
    {"avatar", "least ms", true, 0.4, "posing, records, color net of each; object, losses, pixels stay"},
    {"avatar", "pairs", true, 0.35, "one or two for each, beside those of object and scene"},
    {"avatar", "fragments", true, 0.15, "the same surface; footprints end at the blur of half a pixel"},
    {"image", "least ms", false, 0.55, "each Gaussian's part stays; compositing and loss grow with pixels"},
    {"image", "pairs", false, 0.4, "a tile shows less, so that large Gaussians reach more of them"},
    {"image", "fragments", false, 1.7, "pixels; in small images the blur widens every footprint"},
    {"image", "least ms", true, 0.6, "as in the camera's stage, and losses over touched squares"},
    {"image", "pairs", true, 0.5, "a tile shows less, so that more Gaussians reach several"},
    {"image", "fragments", true, 1.7, "pixels; in small images the blur widens every footprint"},
    {"threads", "least ms", false, -0.9, "all that is long is done on every thread"},
    {"threads", "processor ms", false, 0, "the same work"},
    {"threads", "processor ms", true, 0, "the same work, and threads that wait"},
    {"threads", "pairs", false, 0, "results do not depend on it"},
    {"threads", "fragments", false, 0, "results do not depend on it"},
    {"threads", "least ms", true, -0.8, "short loops, between which threads wait for each other"},
    {"threads", "pairs", true, 0, "results do not depend on it"},
    {"threads", "fragments", true, 0, "results do not depend on it"},
}};

/// None for stages of another kind than those that draw the scene and move the camera, or draw all and leave it.
/// Processor time is expected to grow as time does, where nothing else was thought of it.
const Expectation* expectation_of(const std::string& axis, const std::string& quantity, const ScalingCost& cost) {
  if (cost.moves_camera == cost.draws_all) return nullptr;
  const auto is_it = [&](const Expectation& e) {
    return e.axis == axis && e.quantity == quantity && e.draws_all == cost.draws_all;
  };
  const auto* const place = std::find_if(kExpectations.begin(), kExpectations.end(), is_it);
  if (place != kExpectations.end()) return place;
  return quantity == "processor ms" ? expectation_of(axis, "least ms", cost) : nullptr;
}

/// Least squares of log y over log x: {exponent, scale}; none where there is no line.
std::optional<std::pair<double, double>> power_law(const std::vector<std::pair<double, double>>& points) {
  double x = 0, y = 0, xx = 0, xy = 0;
  const auto n = static_cast<double>(points.size());
  for (const auto& [value, quantity] : points) {
    if (!(value > 0 && quantity > 0)) return std::nullopt;
    const double u = std::log(value), v = std::log(quantity);
    x += u, y += v, xx += u * u, xy += u * v;
  }
  const double spread = n * xx - x * x;
  if (points.size() < 2 || !(spread > 0)) return std::nullopt;
  const double exponent = (n * xy - x * y) / spread;
  return std::pair{exponent, std::exp((y - exponent * x) / n)};
}

double quantity_of(const ScalingCost& cost, const std::string& name) {
  if (name == "least ms") return cost.min_ms;
  if (name == "processor ms") return cost.processor_ms;
  return static_cast<double>(name == "pairs" ? cost.pairs : cost.fragments);
}

}  // namespace

const std::vector<ScalingAxis>& scaling_axes() {
  static const std::vector<ScalingAxis> all = {
      {"scene", "synthetic.scene_gaussians", "Gaussians of the scene", {100000, 200000, 500000, 1000000, 2000000}},
      {"avatar", "synthetic.avatar_gaussians", "Gaussians of the human", {10000, 30000, 100000, 300000}},
      {"image", "synthetic.size_px", "width and height of the image, px", {256, 512, 1024, 2048}},
      {"threads", "threads", "threads", {1, 2}}};
  return all;
}

std::vector<ScalingAxis> chosen_axes(const std::vector<std::string>& words) {
  if (words.empty()) return scaling_axes();
  std::vector<ScalingAxis> axes;
  for (const std::string& word : words) {
    const std::size_t end = word.find('=');
    ScalingAxis axis = axis_named(word.substr(0, end), word);
    if (end != std::string::npos) axis.values = numbers_in(word.substr(end + 1), word);
    const auto is_it = [&axis](const ScalingAxis& other) { return other.name == axis.name; };
    if (std::any_of(axes.begin(), axes.end(), is_it)) refuse(word, "the axis was named before");
    axes.push_back(std::move(axis));
  }
  return axes;
}

std::vector<ScalingFit> scaling_fits(const ScalingAxis& axis, const std::vector<ScalingPoint>& points) {
  std::vector<ScalingFit> fits;
  if (points.empty()) return fits;
  for (std::size_t s = 0; s < points.front().stages.size(); ++s) {
    for (const char* quantity : {"least ms", "processor ms", "pairs", "fragments"}) {
      std::vector<std::pair<double, double>> measured;
      for (const ScalingPoint& point : points)
        measured.emplace_back(static_cast<double>(point.value), quantity_of(point.stages[s], quantity));
      ScalingFit fit{points.front().stages[s].stage, quantity, {}, {}, 0, ""};
      if (const Expectation* expected = expectation_of(axis.name, quantity, points.front().stages[s])) {
        fit.expected = expected->exponent;
        fit.reason = expected->reason;
      }
      if (const auto law = power_law(measured)) {
        fit.fitted = law->first;
        fit.scale = law->second;
      }
      fits.push_back(std::move(fit));
    }
  }
  return fits;
}

}  // namespace hsi4d
