#include "core/image_io.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <limits>
#include <turbojpeg.h>
#include <unistd.h>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/png.h"
#include "stress/scratch_folder.h"
#include "tests/support/crc32.h"
#include "tests/support/measures.h"
#include "tests/support/png_chunk.h"

namespace image_io_test {

using namespace hsi4d;
using Catch::Contains;

namespace {

/// Every multiple of 1/largest that an image of this size can hold, in another order per channel.
Image steps(int channels, int height, int width, int largest) {
  Image image(channels, height, width);
  for (int c = 0; c < channels; ++c) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const int step = ((y * width + x) * (2 * c + 1) + 17 * c) % (largest + 1);
        image(c, y, x) = static_cast<float>(step) / static_cast<float>(largest);
      }
    }
  }
  return image;
}

float one_pixel(float value, const ImageFormat& format) {
  Image image(1, 1, 1);
  image(0, 0, 0) = value;
  return decode_image(encode_image("a.png", image, format), "a.png")(0, 0, 0);
}

void put_be32(Bytes& file, size_t at, uint32_t value) {
  for (int i = 0; i < 4; ++i) file[at + i] = static_cast<uint8_t>(value >> (24 - 8 * i));
}

/// A PNG whose header claims another size.
Bytes png_claiming(uint32_t width, uint32_t height) {
  Bytes file = encode_image("a.png", steps(3, 4, 4, 255));
  put_be32(file, 16, width);
  put_be32(file, 20, height);
  put_be32(file, 29, crc32_of(std::span(file).subspan(12, 17)));
  return file;
}

}  // namespace

TEST_CASE("PNG keeps v/255 and v/65535 exactly, with 1 to 4 channels") {
  for (int channels = 1; channels <= 4; ++channels) {
    const Image eight = steps(channels, 17, 31, 255);
    CHECK(decode_image(encode_image("a.png", eight), "a.png") == eight);
    const Image sixteen = steps(channels, 257, 256, 65535);
    CHECK(decode_image(encode_image("a.PNG", sixteen, {.png_bits = 16}), "a.png") == sixteen);
  }
}

TEST_CASE("transparent pixels keep their colour") {
  Image image(4, 1, 2);
  image(0, 0, 0) = image(1, 0, 1) = 1;
  image(3, 0, 1) = 1.0f / 255;
  CHECK(decode_image(encode_image("a.png", image), "a.png") == image);
}

TEST_CASE("PNG numbers are rounded to nearest and clamped") {
  const float infinity = std::numeric_limits<float>::infinity();
  CHECK(one_pixel(100.49f / 255, {}) == 100.0f / 255);
  CHECK(one_pixel(100.51f / 255, {}) == 101.0f / 255);
  CHECK(one_pixel(-0.3f, {}) == 0);
  CHECK(one_pixel(1.5f, {}) == 1);
  CHECK(one_pixel(infinity, {}) == 1);
  CHECK(one_pixel(-infinity, {}) == 0);
  CHECK(one_pixel(1234.49f / 65535, {.png_bits = 16}) == 1234.0f / 65535);
  Image image(3, 2, 5);
  image(2, 1, 4) = std::numeric_limits<float>::quiet_NaN();
  CHECK_THROWS_WITH(encode_image("out/a.png", image),
                    "out/a.png: the number at row 1, column 4, channel 2 is NaN, which this format cannot hold");
}

TEST_CASE("JPEG comes back close, and closer with more quality") {
  Image image(3, 40, 48);
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < 40; ++y) {
      for (int x = 0; x < 48; ++x) image(c, y, x) = 0.5f + 0.4f * std::sin(0.1f * static_cast<float>(x + c * y));
    }
  }
  const auto worst = [&](int quality) {
    const Image back = decode_image(encode_image("a.jpg", image, {.jpeg_quality = quality}), "a.jpg");
    REQUIRE(back.channels() == 3);
    REQUIRE(back.width() == 48);
    float largest = 0;
    for (size_t i = 0; i < image.data().size(); ++i) {
      largest = test::larger(largest, std::abs(back.data()[i] - image.data()[i]));
    }
    return largest;
  };
  CHECK(worst(100) < 0.02f);
  CHECK(worst(10) > 2 * worst(100));
  CHECK(decode_image(encode_image("a.jpeg", take_channels(image, 0, 1)), "a.jpeg").channels() == 1);
  const ImageFormat half{.jpeg_quality = 80, .jpeg_half_color = true};
  CHECK(10 * encode_image("a.jpg", image, half).size() < 9 * encode_image("a.jpg", image, {.jpeg_quality = 80}).size());
  CHECK(decode_image(encode_image("a.jpg", image, half), "a.jpg").width() == 48);
}

TEST_CASE("a JPEG of inks becomes RGB") {
  // Four inks as Adobe's programs write them (255: none): blue, half black over all, of one block.
  Bytes inks;
  for (int i = 0; i < 64; ++i) inks.insert(inks.end(), {0, 51, 255, 128});
  Bytes file(tjBufSize(8, 8, TJSAMP_444));
  unsigned char* begin = file.data();
  auto size = static_cast<unsigned long>(file.size());
  const tjhandle codec = tjInitCompress();
  REQUIRE(tjCompress2(codec, inks.data(), 8, 0, 8, TJPF_CMYK, &begin, &size, TJSAMP_444, 100, TJFLAG_NOREALLOC) == 0);
  tjDestroy(codec);
  const Image image = decode_image(std::span(file.data(), size), "a.jpg");
  REQUIRE(image.channels() == 3);
  CHECK(image(0, 4, 4) * 255 == Approx(0).margin(1.01));
  CHECK(image(1, 4, 4) * 255 == Approx(51 * 128 / 255.0).margin(1.01));
  CHECK(image(2, 4, 4) * 255 == Approx(128).margin(1.01));
}

TEST_CASE("OpenEXR images keep every float, half is rounded") {
  for (int channels = 1; channels <= 4; ++channels) {
    Image image = steps(channels, 5, 21, 1000);
    image(0, 1, 1) = -3e30f;
    image(0, 2, 2) = std::numeric_limits<float>::infinity();
    CHECK(decode_image(encode_image("a.exr", image), "a.exr") == image);
    image(0, 1, 1) = -3;
    const Image half = decode_image(encode_image("a.exr", image, {.exr_half = true}), "a.exr");
    CHECK(half != image);
    CHECK(half(0, 2, 2) == image(0, 2, 2));
    for (int x = 0; x < 21; ++x) CHECK(half(0, 0, x) == Approx(image(0, 0, x)).epsilon(1.0 / 2048));
  }
}

TEST_CASE("image files are written and read back by path") {
  const ScratchFolder folder;
  const Image image = steps(3, 9, 14, 255);
  for (const char* name : {"a.png", "\xc3\xa4.exr"}) {
    write_image(folder / name, image);
    CHECK(read_image(folder / name) == image);
  }
  CHECK(folder.count() == 2);
  // A format that only OpenImageIO knows: a Netpbm file written by hand.
  write_text_file(folder / "b.ppm", "P6\n2 1\n255\n\x01\x02\x03\xff\x80\x40");
  const Image ppm = read_image(folder / "b.ppm");
  REQUIRE(ppm.channels() == 3);
  CHECK(ppm(0, 0, 1) == 1);
  CHECK(ppm(1, 0, 1) == 128.0f / 255);
  CHECK(ppm(2, 0, 0) == 3.0f / 255);
}

TEST_CASE("images that cannot be written say why") {
  const Image image = steps(3, 2, 2, 255);
  CHECK_THROWS_WITH(encode_image("a.gif", image), "a.gif: images are written as .png, .jpg, .jpeg or .exr");
  CHECK_THROWS_WITH(encode_image("dir.png/a", image), "dir.png/a: images are written as .png, .jpg, .jpeg or .exr");
  CHECK_THROWS_WITH(encode_image("a.jpg", Image(1, 1, 65501)),
                    "a.jpg: a JPEG has at most 65500 pixels a side, not 65501 x 1");
  CHECK_THROWS_WITH(encode_image("a.png", image, {.png_bits = 12}), "a.png: PNG with 12 bits; 8 and 16 are allowed");
  CHECK_THROWS_WITH(encode_image("a.jpg", image, {.jpeg_quality = 0}),
                    "a.jpg: JPEG with quality 0; 1 to 100 is allowed");
  CHECK_THROWS_WITH(encode_image("a.jpg", Image(4, 2, 2)),
                    "a.jpg: cannot be written: the image has 4 channels; this format takes 1 or 3");
  CHECK_THROWS_WITH(encode_image("a.png", Image(3, 0, 2)), "a.png: cannot be written: the image has no pixels");
  CHECK_THROWS_AS(encode_image("a.exr", Image(5, 2, 2)), UserError);
}

TEST_CASE("files that are no image, are missing or damaged say why") {
  const ScratchFolder folder;
  CHECK_THROWS_AS(read_image(folder / "absent.png"), UserError);
  CHECK_THROWS_WITH(read_image(folder / "absent.png"), Contains("absent.png: cannot be read: No such file"));
  write_text_file(folder / "text.png", "not an image at all");
  CHECK_THROWS_AS(read_image(folder / "text.png"), DataError);
  CHECK_THROWS_WITH(read_image(folder / "text.png"), Contains("text.png: cannot be decoded: "));
  write_text_file(folder / "empty.png", "");
  CHECK_THROWS_WITH(read_image(folder / "empty.png"), Contains("empty.png: is empty"));
  CHECK_THROWS_WITH(decode_image(Bytes{1, 2, 3}, "x"), "x: is not a PNG, JPEG or OpenEXR file");
}

TEST_CASE("a truncated image is an error at any length") {
  const Image image = steps(3, 64, 80, 255);
  for (const std::string name : {"a.png", "a.jpg", "a.exr"}) {
    const Bytes file = encode_image(name, image);
    for (const size_t size : {size_t{9}, file.size() / 3, file.size() / 2, file.size() * 9 / 10, file.size() - 1}) {
      const std::span part(file.data(), size);
      INFO(name << " cut to " << part.size() << " of " << file.size() << " bytes");
      CHECK_THROWS_AS(decode_image(part, name), DataError);
    }
  }
  const Bytes png = encode_image("a.png", image);
  CHECK_THROWS_WITH(decode_image(std::span(png.data(), png.size() / 2), "a.png"),
                    "a.png: cannot be decoded as PNG: the file ends early");
}

TEST_CASE("a PNG whose chunk cICP names HDR or a wide gamut is refused") {
  const Bytes png = encode_image("a.png", steps(3, 4, 4, 255));
  const auto refusal = [&png](char primaries, char transfer) -> std::string {
    const std::array<char, 4> content = {primaries, transfer, 0, 1};
    try {
      decode_image(test::with_png_chunk(png, "cICP", {content.data(), content.size()}), "a.png");
    } catch (const DataError& error) {
      return error.what();
    }
    return "";
  };
  const std::string way = " by its chunk cICP (numbers of H.273); allowed are colours of sRGB, BT.709 or BT.601";
  CHECK(refusal(9, 16) == "a.png: has the transfer 16 (PQ, HDR)" + way);
  CHECK(refusal(1, 18) == "a.png: has the transfer 18 (HLG, HDR)" + way);
  CHECK(refusal(1, 8) == "a.png: has the transfer 8" + way);
  CHECK(refusal(12, 13) == "a.png: has the primaries 12 (Display P3)" + way);
  CHECK(refusal(1, 13).empty());
  CHECK(refusal(2, 2).empty());
}

TEST_CASE("a profile of a wide gamut is found in a PNG") {
  const Bytes png = encode_image("a.png", steps(3, 4, 4, 255));
  const auto found = [&png](std::string_view name) {
    return wide_profile(test::with_png_chunk(png, "iCCP", std::string(name) + std::string("\0\0x", 3)));
  };
  CHECK(found("Display P3") == "Display P3");
  CHECK(found("sRGB IEC61966-2.1").empty());
  CHECK(wide_profile(png).empty());
  CHECK(wide_profile({}).empty());
}

TEST_CASE("a damaged PNG is noticed") {
  Bytes file = encode_image("a.png", steps(3, 64, 80, 255));
  file[file.size() / 2] ^= 0x10;
  CHECK_THROWS_AS(decode_image(file, "a.png"), DataError);
}

TEST_CASE("damaged images leave nothing on the standard error stream") {
  const ScratchFolder folder;
  const std::string written = folder / "stderr.txt";
  const int before = ::dup(2);
  REQUIRE(std::freopen(written.c_str(), "w", stderr) != nullptr);
  int errors = 0;
  for (const std::string name : {"a.png", "a.jpg", "a.exr"}) {
    const Bytes file = encode_image(name, steps(3, 24, 20, 255));
    for (size_t i = 0; i < file.size(); i += 7) {
      Bytes damaged = file;
      damaged[i] ^= 0xff;
      try {
        decode_image(damaged, name);
      } catch (const DataError&) {
        ++errors;
      }
    }
  }
  std::fflush(stderr);
  ::dup2(before, 2);
  ::close(before);
  CHECK(errors > 30);
  CHECK(read_text_file(written).empty());
}

TEST_CASE("a header that claims too much is refused before memory is taken") {
  CHECK_THROWS_WITH(decode_image(png_claiming(70000, 3), "a.png"),
                    "a.png: has 70000 x 3 pixels; a side has at most 65536");
  CHECK_THROWS_WITH(decode_image(png_claiming(65000, 65000), "a.png"),
                    "a.png: 3 channels of 65000 x 65000 pixels need more than the 4294967296 bytes allowed");
  Bytes jpeg = encode_image("a.jpg", steps(3, 4, 4, 255));
  const uint8_t frame[] = {0xff, 0xc0, 0x00, 0x11, 0x08};
  const auto at = std::search(jpeg.begin(), jpeg.end(), std::begin(frame), std::end(frame));
  REQUIRE(at != jpeg.end());
  for (int i = 0; i < 4; ++i) at[5 + i] = i % 2 == 0 ? 0xff : 0x00;  // libjpeg has a limit of 65500 of its own
  CHECK_THROWS_WITH(decode_image(jpeg, "a.jpg"),
                    "a.jpg: 3 channels of 65280 x 65280 pixels need more than the 4294967296 bytes allowed");
  std::fill_n(at + 5, 4, uint8_t{0x40});
  CHECK_THROWS_WITH(decode_image(jpeg, "a.jpg"), Contains("a.jpg: its header claims 16448 x 16448 pixels, more than "));
  CHECK_THROWS_WITH(decode_image(std::span(jpeg.data(), 8), "a.jpg"),
                    "a.jpg: cannot be decoded as JPEG: it has no frame");
  CHECK_THROWS_WITH(
      decode_image(png_claiming(16000, 16000), "a.png"),
      Contains("a.png: its header claims 16000 x 16000 pixels, more than its ") && Contains(" bytes can hold"));
}

}  // namespace image_io_test
