// Any bytes as one of the three files of a model of COLMAP, text or binary, beside two that are right. The first byte
// says which.
#include <cstring>
#include <string>
#include <string_view>

#include "pipelines/photos/colmap.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz::colmap_fuzz {

namespace {

constexpr std::string_view kCameras = "1 OPENCV 64 48 50 51 32.5 24.25 0.1 -0.02 0.001 -0.002\n2 PINHOLE 8 6 5 5 4 3\n";
constexpr std::string_view kImages = "7 0 1 0 0 1 2 3 1 b.jpg\n10.5 20.5 3\n8 1 0 0 0 -1 0.5 4 2 a b.png\n\n";
constexpr std::string_view kPoints = "# points\n3 1.5 -2 3 255 0 51 0.3 7 0 8 1\n4 0 0 1 1 2 3 0.1\n";

Bytes bytes_of(std::string_view text) { return Bytes(text.begin(), text.end()); }

template <class T>
void put(Bytes& bytes, T value) {
  bytes.resize(bytes.size() + sizeof(T));
  std::memcpy(bytes.data() + bytes.size() - sizeof(T), &value, sizeof(T));
}

Bytes binary_cameras() {
  Bytes bytes;
  put<std::uint64_t>(bytes, 1);
  put<std::int32_t>(bytes, 1);
  put<std::uint32_t>(bytes, 2);
  put<std::uint64_t>(bytes, 64);
  put<std::uint64_t>(bytes, 48);
  for (const double p : {50.0, 32.5, 24.25, 0.1}) put(bytes, p);
  return bytes;
}

Bytes binary_images() {
  Bytes bytes;
  put<std::uint64_t>(bytes, 1);
  put<std::int32_t>(bytes, 7);
  for (const double p : {1.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0}) put(bytes, p);
  put<std::int32_t>(bytes, 1);
  for (const char c : {'a', '\0'}) bytes.push_back(static_cast<std::uint8_t>(c));
  put<std::uint64_t>(bytes, 1);
  put(bytes, 1.5);
  put(bytes, 2.5);
  put<std::int64_t>(bytes, -1);
  return bytes;
}

Bytes binary_points() {
  Bytes bytes;
  put<std::uint64_t>(bytes, 1);
  put<std::uint64_t>(bytes, 3);
  for (const double p : {1.5, -2.0, 3.0}) put(bytes, p);
  for (const int c : {255, 0, 51}) bytes.push_back(static_cast<std::uint8_t>(c));
  put(bytes, 0.3);
  put<std::uint64_t>(bytes, 1);
  put<std::uint64_t>(bytes, 7);
  return bytes;
}

Bytes with_choice(int choice, Bytes file) {
  file.insert(file.begin(), static_cast<std::uint8_t>(choice));
  return file;
}

}  // namespace

std::vector<Bytes> corpus() {
  return {with_choice(0, bytes_of(kCameras)), with_choice(1, bytes_of(kImages)), with_choice(2, bytes_of(kPoints)),
          with_choice(3, binary_cameras()),   with_choice(4, binary_images()),   with_choice(5, binary_points())};
}

bool accepts(std::span<const uint8_t> file) {
  if (file.empty()) return false;
  const unsigned choice = file[0] % 6U;
  const std::string ending = choice < 3 ? ".txt" : ".bin";
  std::vector<Bytes> files = {bytes_of(kCameras), bytes_of(kImages), bytes_of(kPoints)};
  if (choice >= 3) files = {binary_cameras(), binary_images(), binary_points()};
  files[choice % 3].assign(file.begin() + 1, file.end());
  return is_read([&] {
    const ColmapModel model =
        decode_colmap({"c" + ending, files[0]}, {"i" + ending, files[1]}, {"p" + ending, files[2]});
    for (const PosedImage& image : model.images) check_camera(image.camera, "an accepted camera");
    for (const ColoredPoint& point : model.points)
      HSI4D_CHECK(point.place.allFinite(), "a point at no finite place was taken");
  });
}

const Target target("colmap", corpus, accepts);

}  // namespace hsi4d::fuzz::colmap_fuzz
