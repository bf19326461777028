// Embeddings by CLIP. What is taken has finite metrics.
#include <cmath>

#include "core/check.h"
#include "core/npz.h"
#include "pipelines/metrics/clip_embeddings.h"
#include "tests/fuzz/archive_list.h"

namespace hsi4d::fuzz::clip_embeddings_fuzz {

namespace {

Bytes small_embeddings() {
  NpzWriter file;
  file.add<float>("image_embeddings", {3, 2}, {1, 0, 0.5F, 0.5F, 0, 1});
  file.add<float>("text_embedding", {2}, {1, 1});
  file.add_scalar("frame_rate", 10.0);
  file.add_text("model", "ViT-B/32");
  file.add_text("prompt", "a person");
  return file.encode();
}

}  // namespace

std::vector<Bytes> corpus() { return {list_of(small_embeddings()), small_embeddings()}; }

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    for (const auto& [name, value] : clip_metrics(decode_clip_embeddings(archive_of(file), "fuzz.npz")))
      HSI4D_CHECK(std::isfinite(value), name + " is not finite");
  });
}

const Target target("clip_embeddings", corpus, accepts);

}  // namespace hsi4d::fuzz::clip_embeddings_fuzz
