#include "pipelines/draw/frame_images.h"

#include <algorithm>

#include <catch2/catch.hpp>

namespace frame_images_test {

using namespace hsi4d;

TEST_CASE("a share of the pixels is kept in whole blocks, spread evenly, others in every frame") {
  for (const double share : {0.25, 0.5, 0.8}) {
    Image kept_before;
    for (const Index frame : {1, 2, 3}) {
      Image weight(1, 512, 480);
      std::ranges::fill(weight.data(), 0.7F);
      keep_share(share, frame, weight);
      Index kept = 0, most_in_row = 0;
      for (int y = 0; y < 512; y += 32) {
        Index in_row = 0;
        for (int x = 0; x < 480; x += 32) {
          const float value = weight(0, y, x);
          CHECK((value == 0.0F || value == 0.7F));
          bool is_whole = true;
          for (int i = 0; i < 32 * 32; ++i) is_whole = is_whole && weight(0, y + i / 32, x + i % 32) == value;
          CHECK(is_whole);
          in_row += value > 0 ? 1 : 0;
        }
        kept += in_row;
        most_in_row = std::max(most_in_row, in_row);
      }
      INFO("share " << share << ", frame " << frame << ": " << kept << " of 240 blocks");
      CHECK(static_cast<double>(kept) / 240 == Approx(share).margin(0.03));
      CHECK(static_cast<double>(most_in_row) <= share * 15 + 2);
      if (!kept_before.empty()) CHECK_FALSE(kept_before == weight);
      kept_before = weight;
    }
  }
  for (int frame = 0; frame < 10; ++frame) {  // one block: it stays, or there would be nothing to see
    Image small(1, 30, 30);
    std::ranges::fill(small.data(), 0.5F);
    keep_share(0.1, frame, small);
    CHECK(small(0, 3, 3) == 0.5F);
  }
  Image all(1, 40, 40);
  std::ranges::fill(all.data(), 1.0F);
  keep_share(1, 5, all);
  for (int i = 0; i < 1600; ++i) CHECK(all(0, i / 40, i % 40) == 1);
}

}  // namespace frame_images_test
