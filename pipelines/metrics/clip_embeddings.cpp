#include "pipelines/metrics/clip_embeddings.h"

#include <algorithm>
#include <cmath>

#include "body/motion_io.h"
#include "core/check.h"
#include "core/npz.h"
#include "core/text.h"

namespace hsi4d {
namespace {

constexpr double kPercent = 100;

double length_of(std::span<const double> row) {
  double squares = 0, largest = 0;
  for (const double x : row) largest = std::max(largest, std::fabs(x));
  if (largest == 0) return 0;
  for (const double x : row) squares += (x / largest) * (x / largest);
  return largest * std::sqrt(squares);
}

/// Rows of `width` finite numbers, each with a length.
void check_rows(const NpyArray& array, std::span<const double> numbers, std::size_t width) {
  for (std::size_t first = 0; first < numbers.size(); first += width) {
    const std::span<const double> row = numbers.subspan(first, width);
    const std::string where = array.source() + ": row " + std::to_string(first / width);
    if (!std::all_of(row.begin(), row.end(), [](double x) { return std::isfinite(x); }))
      throw DataError(where + " has a number that is not finite");
    const double length = length_of(row);
    if (!(length > 0 && std::isfinite(length)))
      throw DataError(where + (length > 0 ? " is too long" : " is all zeros") + " and has no direction");
  }
}

std::string text_of(const Npz& file, const char* name) { return file.has(name) ? file.array(name).text() : ""; }

ClipEmbeddings embeddings_of(const Npz& file) {
  ClipEmbeddings embeddings;
  const NpyArray& images = file.array("image_embeddings").require_shape({-1, -1});
  embeddings.frames = images.shape()[0];
  embeddings.width = images.shape()[1];
  if (embeddings.frames == 0 || embeddings.width == 0)
    throw DataError(images.source() + ": has shape " + shape_text(images.shape()) + ": holds no embedding");
  embeddings.images = images.as<double>();
  const auto width = static_cast<std::size_t>(embeddings.width);
  check_rows(images, embeddings.images, width);
  const NpyArray& text = file.array("text_embedding");
  const auto& shape = text.shape();
  const bool fits = (shape.size() == 1 || (shape.size() == 2 && shape[0] == 1)) && shape.back() == embeddings.width;
  if (!fits)
    throw DataError(text.source() + ": has shape " + shape_text(shape) + "; [" + std::to_string(embeddings.width) +
                    "] is needed, as image_embeddings has it");
  embeddings.text = text.as<double>();
  check_rows(text, embeddings.text, width);
  if (file.has("frame_rate")) {
    embeddings.frame_rate = file.array("frame_rate").scalar<double>();
    if (!(embeddings.frame_rate >= kSlowestMotion && embeddings.frame_rate <= kFastestMotion))
      throw DataError(file.array("frame_rate").source() + ": is " + number_text(embeddings.frame_rate) +
                      " frames a second; allowed: " + number_text(kSlowestMotion) + " to " +
                      rounded(kFastestMotion, 6));
  }
  embeddings.model = text_of(file, "model");
  embeddings.prompt = text_of(file, "prompt");
  return embeddings;
}

double cosine(std::span<const double> a, std::span<const double> b) {
  const double length_a = length_of(a), length_b = length_of(b);
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] / length_a) * (b[i] / length_b);
  return sum;
}

}  // namespace

ClipEmbeddings read_clip_embeddings(const std::string& path) { return embeddings_of(Npz::read(path)); }

ClipEmbeddings decode_clip_embeddings(std::span<const std::uint8_t> file, const std::string& name) {
  return embeddings_of(Npz::decode(file, name));
}

MetricValues clip_metrics(const ClipEmbeddings& embeddings) {
  const auto frame = [&embeddings](Index t) {
    return std::span(embeddings.images)
        .subspan(static_cast<std::size_t>(t * embeddings.width), static_cast<std::size_t>(embeddings.width));
  };
  double score = 0;
  for (Index t = 0; t < embeddings.frames; ++t) score += cosine(frame(t), embeddings.text);
  MetricValues values = {{"clip_score", kPercent * score / static_cast<double>(embeddings.frames)}};
  const Index step = std::max<Index>(1, std::llround(embeddings.frame_rate * kAdjacentSeconds));
  if (embeddings.frames <= step) return values;
  double consistency = 0;
  for (Index t = 0; t + step < embeddings.frames; ++t) consistency += cosine(frame(t), frame(t + step));
  values.emplace_back("clip_consistency", kPercent * consistency / static_cast<double>(embeddings.frames - step));
  return values;
}

}  // namespace hsi4d
