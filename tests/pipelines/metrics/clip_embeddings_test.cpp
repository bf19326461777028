#include "pipelines/metrics/clip_embeddings.h"

#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/npz.h"
#include "core/random.h"

namespace clip_embeddings_test {

using namespace hsi4d;
using Catch::Matchers::Contains;

namespace {

Bytes archive(std::int64_t frames, std::int64_t width, const std::vector<double>& images,
              const std::vector<double>& text, double rate = 0) {
  NpzWriter file;
  file.add<double>("image_embeddings", {frames, width}, images);
  file.add<double>("text_embedding", {std::ssize(text)}, text);
  if (rate != 0) file.add_scalar("frame_rate", rate);
  return file.encode();
}

std::string fault(const Bytes& file) {
  try {
    decode_clip_embeddings(file, "e.npz");
  } catch (const DataError& error) {
    return error.what();
  }
  return "";
}

double value(const ClipEmbeddings& embeddings, const char* name) {
  const MetricValues values = clip_metrics(embeddings);
  const double* const found = find_metric(values, name);
  REQUIRE(found != nullptr);
  return *found;
}

}  // namespace

TEST_CASE("CLIP score and consistency have the values of a pencil and paper") {
  // Cosines with the text 1, 0.6 and 0; of neighbours 0.6 and 0.8. Lengths do not count.
  const ClipEmbeddings embeddings = decode_clip_embeddings(archive(3, 2, {2, 0, 3, 4, 0, 7}, {5, 0}), "e.npz");
  CHECK(value(embeddings, "clip_score") == Approx(100 * 1.6 / 3));
  CHECK(value(embeddings, "clip_consistency") == Approx(70));
  const ClipEmbeddings one = decode_clip_embeddings(archive(1, 2, {-1, 0}, {5, 0}), "e.npz");
  CHECK(value(one, "clip_score") == Approx(-100));
  CHECK(clip_metrics(one).size() == 1);
}

TEST_CASE("CLIP metrics agree with plain loops") {
  RandomSequence random(4);
  std::vector<double> images(20 * 16), text(16);
  for (double& x : images) x = random.uniform(-1, 1);
  for (double& x : text) x = random.uniform(-1, 1);
  const auto cosine = [](const double* a, const double* b) {
    double ab = 0, aa = 0, bb = 0;
    for (int i = 0; i < 16; ++i) {
      ab += a[i] * b[i];
      aa += a[i] * a[i];
      bb += b[i] * b[i];
    }
    return ab / std::sqrt(aa * bb);
  };
  double score = 0, adjacent = 0, tenth = 0;
  for (int t = 0; t < 20; ++t) score += cosine(&images[static_cast<std::size_t>(16 * t)], text.data());
  for (int t = 0; t < 19; ++t)
    adjacent += cosine(&images[static_cast<std::size_t>(16 * t)], &images[static_cast<std::size_t>(16 * (t + 1))]);
  for (int t = 0; t < 17; ++t)
    tenth += cosine(&images[static_cast<std::size_t>(16 * t)], &images[static_cast<std::size_t>(16 * (t + 3))]);
  for (const double rate : {0.0, 5.0, 10.0, 12.0}) {
    const ClipEmbeddings embeddings = decode_clip_embeddings(archive(20, 16, images, text, rate), "e.npz");
    CHECK(value(embeddings, "clip_score") == Approx(5 * score).epsilon(1e-12));
    CHECK(value(embeddings, "clip_consistency") == Approx(100 * adjacent / 19).epsilon(1e-12));
  }
  // At 30 frames a second what is adjacent at 10 is three frames apart.
  const ClipEmbeddings fast = decode_clip_embeddings(archive(20, 16, images, text, 30), "e.npz");
  CHECK(value(fast, "clip_consistency") == Approx(100 * tenth / 17).epsilon(1e-12));
}

TEST_CASE("consistency of a video does not depend on its frame rate") {
  // An embedding that turns at 0.5 rad/s: 0.1 s are 0.05 rad, at any rate.
  for (const int rate : {10, 30, 60, 120}) {
    std::vector<double> images;
    for (int t = 0; t <= 2 * rate; ++t) {
      const double angle = 0.5 * t / rate;
      images.insert(images.end(), {std::cos(angle), std::sin(angle)});
    }
    const ClipEmbeddings embeddings = decode_clip_embeddings(archive(2 * rate + 1, 2, images, {1, 0}, rate), "e.npz");
    CHECK(value(embeddings, "clip_consistency") == Approx(100 * std::cos(0.05)).epsilon(1e-9));
    CHECK(value(embeddings, "clip_score") == Approx(100 * std::sin(1.0)).epsilon(0.02));
  }
}

TEST_CASE("embeddings are read, and what is wrong with them is told") {
  const double infinity = std::numeric_limits<double>::infinity();
  NpzWriter file;
  file.add<float>("image_embeddings", {1, 2}, {1, 0});
  file.add<float>("text_embedding", {1, 2}, {1, 0});
  file.add_text("model", "ViT-B/32");
  file.add_text("prompt", "a person waters flowers");
  const ClipEmbeddings read = decode_clip_embeddings(file.encode(), "e.npz");
  CHECK(read.model == "ViT-B/32");
  CHECK(read.prompt == "a person waters flowers");
  CHECK(read.frame_rate == 0);
  CHECK(fault(archive(2, 2, {1, 0, 0, 0}, {1, 0})) ==
        "e.npz: array 'image_embeddings': row 1 is all zeros and has no direction");
  CHECK(fault(archive(2, 2, {1, 0, infinity, 0}, {1, 0})) ==
        "e.npz: array 'image_embeddings': row 1 has a number that is not finite");
  CHECK(fault(archive(1, 2, {1, 0}, {1, 0, 0})) ==
        "e.npz: array 'text_embedding': has shape [3]; [2] is needed, as image_embeddings has it");
  CHECK(fault(archive(1, 2, {1, 0}, {0, 0})) ==
        "e.npz: array 'text_embedding': row 0 is all zeros and has no direction");
  CHECK_THAT(fault(archive(0, 2, {}, {1, 0})), Contains("holds no embedding"));
  CHECK_THAT(fault(archive(1, 2, {1, 0}, {1, 0}, -1)), Contains("is -1 frames a second; allowed: 0.01 to"));
  NpzWriter empty;
  empty.add_scalar("frame_rate", 1.0);
  CHECK_THAT(fault(empty.encode()), Contains("image_embeddings"));
}

}  // namespace clip_embeddings_test
