#include "core/exr.h"

#include <algorithm>
#include <cmath>

#include <ImfChannelList.h>
#include <ImfDeepFrameBuffer.h>
#include <ImfDeepScanLineOutputFile.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfOutputFile.h>
#include <ImfOutputPart.h>
#include <ImfPartType.h>
#include <ImfTiledOutputFile.h>
#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/image_io.h"
#include "stress/scratch_folder.h"

namespace exr_test {

using namespace hsi4d;
using Catch::Contains;
using Imath::Box2i;
using Imath::V2i;

namespace {

Layers view_layers(int height, int width) {
  Layers layers{{"R", "G", "B", "A", "Z", "mask.human.A", "mask.object.A"}, Image(7, height, width), "view.exr"};
  for (int c = 0; c < 7; ++c) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        layers.planes(c, y, x) = std::sin(static_cast<float>(c + 1)) * static_cast<float>(y * width + x + 1) / 7.0f;
      }
    }
  }
  return layers;
}

/// One channel "Y" whose pixel (x, y) of the data window holds 100 y + x.
std::vector<float> ramp(const Box2i& window) {
  std::vector<float> values;
  for (int y = window.min.y; y <= window.max.y; ++y) {
    for (int x = window.min.x; x <= window.max.x; ++x) values.push_back(static_cast<float>(100 * y + x));
  }
  return values;
}

Imf::Slice slice_of(std::vector<float>& values, const Box2i& window, int sampling = 1) {
  const size_t width = static_cast<size_t>(window.max.x - window.min.x + 1) / static_cast<size_t>(sampling);
  return Imf::Slice::Make(Imf::FLOAT, values.data(), window, 4, 4 * width, sampling, sampling);
}

void write_ramp(const std::string& path, const Box2i& display, const Box2i& window) {
  std::vector<float> values = ramp(window);
  Imf::Header header(display, window);
  header.channels().insert("Y", Imf::Channel(Imf::FLOAT));
  Imf::FrameBuffer buffer;
  buffer.insert("Y", slice_of(values, window));
  Imf::OutputFile file(path.c_str(), header);
  file.setFrameBuffer(buffer);
  file.writePixels(window.max.y - window.min.y + 1);
}

}  // namespace

TEST_CASE("layers come back bit for bit, sorted by name") {
  const Layers layers = view_layers(19, 37);
  const Layers back = decode_layers(encode_layers("view.exr", layers), "view.exr");
  CHECK(back.names == std::vector<std::string>{"A", "B", "G", "R", "Z", "mask.human.A", "mask.object.A"});
  CHECK(back.select(layers.names) == layers.planes);
  CHECK(back.find("Z") == 4);
  CHECK(back.find("mask") == -1);
  CHECK(back.select({"Z"})(0, 3, 4) == layers.planes(4, 3, 4));
  CHECK(back.source == "view.exr");
  CHECK_THROWS_WITH(back.select({"R", "mask.dog.A"}),
                    "view.exr: has no channel 'mask.dog.A'; there are: A, B, G, R, Z, mask.human.A, mask.object.A");
}

TEST_CASE("half layers are rounded, depth is not") {
  const Layers layers = view_layers(6, 9);
  const Layers back = decode_layers(encode_layers("v", layers, ExrPixels::half), "v");
  CHECK(back.select({"Z"}) == layers.select({"Z"}));
  CHECK(back.select({"R"}) != layers.select({"R"}));
  for (int x = 0; x < 9; ++x) CHECK(back.select({"R"})(0, 5, x) == Approx(layers.planes(0, 5, x)).epsilon(1.0 / 2048));
  Layers large = layers;
  large.planes(1, 2, 3) = 70000;
  CHECK_THROWS_WITH(encode_layers("v", large, ExrPixels::half),
                    "v: channel 'G', row 2, column 3: 70000.000000 is beyond the range of half, ±65504");
}

TEST_CASE("layers are written to and read from a path") {
  const ScratchFolder folder;
  const Layers layers = view_layers(6, 9);
  write_layers(folder / "v.exr", layers);
  CHECK(read_layers(folder / "v.exr").select(layers.names) == layers.planes);
  CHECK(read_image(folder / "v.exr") == take_channels(layers.planes, 0, 4));
  CHECK(folder.count() == 1);
  CHECK_THROWS_AS(read_layers(folder / "absent.exr"), UserError);
}

TEST_CASE("an image needs colour channels") {
  const Layers depth{{"Z"}, Image(1, 2, 2), ""};
  CHECK_THROWS_WITH(decode_image(encode_layers("d.exr", depth), "d.exr"), "d.exr: has no channel 'R'; there are: Z");
}

TEST_CASE("layers that do not fit are a bug of the caller") {
  const Image planes(2, 3, 4);
  CHECK_THROWS_WITH(encode_layers("v", {{"R"}, planes, ""}), Contains("(1 against 2)"));
  CHECK_THROWS_WITH(encode_layers("v", {{"R", "R"}, planes, ""}), Contains("v: channel 'R' is there twice"));
  CHECK_THROWS_WITH(encode_layers("v", {{"R", ""}, planes, ""}), Contains("v: channel name ''"));
  CHECK_THROWS_WITH(encode_layers("v", {{}, {}, ""}), Contains("v: no pixels"));
}

TEST_CASE("the planes cover the display window, wherever the data window lies") {
  const ScratchFolder folder;
  const std::string path = folder / "window.exr";
  const Box2i display(V2i(10, 20), V2i(17, 25));
  const auto check = [&](const Box2i& window) {
    write_ramp(path, display, window);
    const Image image = read_image(path);
    REQUIRE(image.width() == 8);
    REQUIRE(image.height() == 6);
    for (int y = 20; y <= 25; ++y) {
      for (int x = 10; x <= 17; ++x) {
        const float expected = window.intersects(V2i(x, y)) ? static_cast<float>(100 * y + x) : 0.0f;
        if (image(0, y - 20, x - 10) != expected)
          FAIL("pixel " << x << ", " << y << " is " << image(0, y - 20, x - 10));
      }
    }
  };
  check(display);
  check(Box2i(V2i(12, 21), V2i(13, 24)));
  check(Box2i(V2i(-5, -7), V2i(40, 33)));
  check(Box2i(V2i(15, 24), V2i(30, 40)));
  write_ramp(path, display, Box2i(V2i(0, 0), V2i(9, 30)));
  CHECK_THROWS_WITH(read_image(path),
                    Contains("its data window (0,0)-(9,30) lies outside of its display window (10,20)-(17,25)"));
}

TEST_CASE("tiled files give their full-size level") {
  const ScratchFolder folder;
  const Box2i window(V2i(0, 0), V2i(44, 36));
  std::vector<float> values = ramp(window);
  Imf::Header header(window, window);
  header.channels().insert("Y", Imf::Channel(Imf::FLOAT));
  header.setTileDescription(Imf::TileDescription(16, 16, Imf::ONE_LEVEL));
  Imf::FrameBuffer buffer;
  buffer.insert("Y", slice_of(values, window));
  {
    Imf::TiledOutputFile file((folder / "tiled.exr").c_str(), header);
    file.setFrameBuffer(buffer);
    file.writeTiles(0, file.numXTiles() - 1, 0, file.numYTiles() - 1);
  }
  CHECK(read_image(folder / "tiled.exr") == from_interleaved(values, 37, 45, 1));
}

TEST_CASE("subsampled, deep and multi-part files are refused by what they are") {
  const ScratchFolder folder;
  const Box2i window(V2i(0, 0), V2i(7, 7));
  std::vector<float> values = ramp(window);
  {
    Imf::Header header(window, window);
    header.channels().insert("RY", Imf::Channel(Imf::FLOAT, 2, 2));
    Imf::FrameBuffer buffer;
    buffer.insert("RY", slice_of(values, window, 2));
    Imf::OutputFile file((folder / "sub.exr").c_str(), header);
    file.setFrameBuffer(buffer);
    file.writePixels(8);
  }
  CHECK_THROWS_WITH(read_layers(folder / "sub.exr"), Contains("channel 'RY' is subsampled 2 x 2, which is not read"));

  Imf::Header header(window, window);
  header.channels().insert("Y", Imf::Channel(Imf::FLOAT));
  Imf::FrameBuffer buffer;
  buffer.insert("Y", slice_of(values, window));
  {
    std::vector<Imf::Header> headers(2, header);
    for (int i = 0; i < 2; ++i) {
      headers[i].setName("part" + std::to_string(i));
      headers[i].setType(Imf::SCANLINEIMAGE);
    }
    Imf::MultiPartOutputFile file((folder / "parts.exr").c_str(), headers.data(), 2);
    for (int i = 0; i < 2; ++i) {
      Imf::OutputPart part(file, i);
      part.setFrameBuffer(buffer);
      part.writePixels(8);
    }
  }
  CHECK_THROWS_WITH(read_layers(folder / "parts.exr"), Contains("has 2 parts; files of one part are read"));

  {
    header.setType(Imf::DEEPSCANLINE);
    header.compression() = Imf::ZIPS_COMPRESSION;
    std::vector<unsigned> counts(64, 1);
    std::vector<float*> samples(64);
    for (size_t i = 0; i < 64; ++i) samples[i] = &values[i];
    Imf::DeepFrameBuffer deep;
    deep.insertSampleCountSlice(
        Imf::Slice(Imf::UINT, reinterpret_cast<char*>(counts.data()), sizeof(unsigned), 8 * sizeof(unsigned)));
    deep.insert("Y", Imf::DeepSlice(Imf::FLOAT, reinterpret_cast<char*>(samples.data()), sizeof(float*),
                                    8 * sizeof(float*), sizeof(float)));
    Imf::DeepScanLineOutputFile file((folder / "deep.exr").c_str(), header);
    file.setFrameBuffer(deep);
    file.writePixels(8);
  }
  CHECK_THROWS_WITH(read_layers(folder / "deep.exr"), Contains("holds deep data, which is not read"));
}

TEST_CASE("an attribute of a layer file has the length of its type") {
  const Bytes file = encode_layers("v.exr", view_layers(4, 4));
  const auto with_size = [&](const std::string& type, uint8_t size) {
    Bytes other = file;
    const std::string wanted = type + '\0';
    const auto at = std::search(other.begin(), other.end(), wanted.begin(), wanted.end());
    REQUIRE(at != other.end());
    at[static_cast<std::ptrdiff_t>(wanted.size())] = size;
    return other;
  };
  CHECK_THROWS_WITH(decode_layers(with_size("box2i", 15), "v.exr"),
                    "v.exr: its attribute \"dataWindow\" has 15 bytes, which is not the length of a box2i");
  CHECK_THROWS_WITH(decode_layers(with_size("chlist", 1), "v.exr"),
                    "v.exr: its attribute \"channels\" has 1 bytes, which is not the length of a chlist");
}

TEST_CASE("a layer file that claims more pixels than it can hold is refused before memory is taken") {
  Bytes file = encode_layers("v.exr", view_layers(4, 4));
  const std::string window = std::string("dataWindow\0box2i\0", 17);
  const auto at = std::search(file.begin(), file.end(), window.begin(), window.end());
  REQUIRE(at != file.end());
  const auto right = at + static_cast<std::ptrdiff_t>(window.size()) + 4 + 8;
  right[1] = right[5] = 0x20;  // 8192 and more to each side, of which the table of lines alone is longer than the file
  CHECK_THROWS_WITH(decode_layers(file, "v.exr"), "v.exr: cannot be read as OpenEXR: the file ends early");
}

TEST_CASE("a damaged layer file is an error with a reason") {
  Bytes file = encode_layers("v.exr", view_layers(40, 40));
  CHECK_THROWS_AS(decode_layers(std::span(file.data(), file.size() - 1), "v.exr"), DataError);
  CHECK_THROWS_WITH(decode_layers(std::span(file.data(), 100), "v.exr"), "v.exr: ends within its OpenEXR header");
  CHECK_THROWS_WITH(decode_layers(Bytes{}, "v.exr"), "v.exr: ends within its OpenEXR header");
  Bytes other = file;
  other[0] ^= 1;
  CHECK_THROWS_WITH(decode_layers(other, "v.exr"), Contains("v.exr: cannot be read as OpenEXR: "));
  const ImageLimits small{1 << 16, 40 * 64 * 3 * 6};
  CHECK_THROWS_WITH(decode_layers(file, "v.exr", small),
                    Contains("v.exr: 7 channels of 40 x 40 pixels need more than the 46080 bytes allowed"));
}

}  // namespace exr_test
