// Any bytes as a file of picked places.
#include <cmath>
#include <string>
#include <string_view>

#include "pipelines/locate/picks.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz::picks_fuzz {

std::vector<Bytes> corpus() {
  constexpr std::string_view kPoints = "# frame 0\nframe_x,frame_y,x,y,z\n1.5,2,3,-4e-1,5\n6,7,8,9,10 # last\n",
                             kPlaces = "frame_x,frame_y,view_x,view_y\r\n1,2,3,4\r\n5,6,7,8";
  return {Bytes(kPoints.begin(), kPoints.end()), Bytes(kPlaces.begin(), kPlaces.end())};
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    const std::vector<Pick> picks = decode_picks(std::string(file.begin(), file.end()), "fuzz.csv");
    HSI4D_CHECK(!picks.empty(), "accepted without picks");
    for (const Pick& pick : picks) {
      HSI4D_CHECK(pick.point_world.has_value() != pick.view_pixel.has_value(), "a pick of both kinds, or of none");
      HSI4D_CHECK(pick.frame_pixel.allFinite(), "an accepted pick is not finite");
    }
  });
}

const Target target("picks", corpus, accepts);

}  // namespace hsi4d::fuzz::picks_fuzz
