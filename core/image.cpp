#include "core/image.h"

#include <algorithm>
#include <string>

#include "core/check.h"

namespace hsi4d {

void check_image_size(const std::string& name, int64_t channels, int64_t height, int64_t width,
                      const ImageLimits& limits) {
  const std::string size = std::to_string(width) + " x " + std::to_string(height) + " pixels";
  if (width > limits.max_side || height > limits.max_side) {
    throw DataError(name + ": has " + size + "; a side has at most " + std::to_string(limits.max_side));
  }
  const int64_t plane_bytes = padded_row<float>(width) * height * int64_t{sizeof(float)};
  if (channels > limits.max_bytes / plane_bytes) {
    throw DataError(name + ": " + std::to_string(channels) + " channels of " + size + " need more than the " +
                    std::to_string(limits.max_bytes) + " bytes allowed");
  }
}

Image::Image(int channels, int height, int width)
    : channels_(channels), height_(height), width_(width), row_stride_(padded_row<float>(width)) {
  const std::string sizes =
      std::to_string(channels) + " channels of " + std::to_string(width) + " x " + std::to_string(height) + " pixels";
  HSI4D_CHECK(channels >= 0 && height >= 0 && width >= 0, sizes);
  // Divisions, since the product itself may overflow.
  constexpr int64_t kMost = int64_t{1} << 48;
  const int64_t numbers_per_row = std::max<int64_t>(1, row_stride_ * height);
  HSI4D_CHECK(channels <= kMost / numbers_per_row, sizes);
  values_.resize(static_cast<size_t>(channels * plane_stride()));
}

Image from_interleaved(std::span<const float> values, int height, int width, int channels) {
  Image image(channels, height, width);
  HSI4D_CHECK_EQ(std::ssize(values), int64_t{height} * width * channels);
  for (int c = 0; c < channels; ++c) {
    for (int y = 0; y < height; ++y) {
      const float* in = values.data() + int64_t{y} * width * channels + c;
      float* out = image.row(c, y);
      for (int x = 0; x < width; ++x) out[x] = in[int64_t{x} * channels];
    }
  }
  return image;
}

std::vector<float> to_interleaved(const Image& image) {
  const int64_t channels = image.channels();
  std::vector<float> values(static_cast<size_t>(image.height() * channels * image.width()));
  for (int c = 0; c < channels; ++c) {
    for (int y = 0; y < image.height(); ++y) {
      const float* in = image.row(c, y);
      float* out = values.data() + y * image.width() * channels + c;
      for (int x = 0; x < image.width(); ++x) out[x * channels] = in[x];
    }
  }
  return values;
}

Image take_channels(const Image& image, int first, int count) {
  HSI4D_CHECK(
      first >= 0 && count >= 0 && count <= image.channels() - first,
      std::to_string(count) + " channels from " + std::to_string(first) + " of " + std::to_string(image.channels()));
  Image result(count, image.height(), image.width());
  std::ranges::copy(image.data().subspan(first * image.plane_stride(), count * image.plane_stride()),
                    result.data().begin());
  return result;
}

Image crop(const Image& image, int top, int left, int height, int width) {
  HSI4D_CHECK(top >= 0 && left >= 0 && height >= 0 && width >= 0 && height <= image.height() - top &&
                  width <= image.width() - left,
              std::to_string(width) + " x " + std::to_string(height) + " at column " + std::to_string(left) + ", row " +
                  std::to_string(top) + " of " + std::to_string(image.width()) + " x " +
                  std::to_string(image.height()));
  Image result(image.channels(), height, width);
  for (int c = 0; c < image.channels(); ++c) {
    for (int y = 0; y < height; ++y) std::copy_n(image.row(c, top + y) + left, width, result.row(c, y));
  }
  return result;
}

namespace {

/// The source pixels [begin, begin + weights.size()) that one result pixel covers along an axis, and their shares.
struct Cover {
  int begin = 0;
  std::vector<double> weights;
};

/// In units of 1/to of a source pixel, result i covers [i from, (i+1) from) and source k covers [k to, (k+1) to).
std::vector<Cover> covers(int from, int to) {
  std::vector<Cover> result(static_cast<size_t>(to));
  for (int64_t i = 0; i < to; ++i) {
    const int64_t begin = i * from, end = begin + from;
    Cover& cover = result[i];
    cover.begin = static_cast<int>(begin / to);
    for (int64_t k = cover.begin; k * to < end; ++k) {
      const int64_t overlap = std::min(end, (k + 1) * to) - std::max(begin, k * to);
      cover.weights.push_back(static_cast<double>(overlap) / from);
    }
  }
  return result;
}

}  // namespace

Image resize_area(const Image& image, int height, int width) {
  HSI4D_CHECK(height > 0 && width > 0 && image.height() > 0 && image.width() > 0,
              std::to_string(image.width()) + " x " + std::to_string(image.height()) + " to " + std::to_string(width) +
                  " x " + std::to_string(height));
  const std::vector<Cover> row_covers = covers(image.height(), height);
  const std::vector<Cover> column_covers = covers(image.width(), width);
  Image result(image.channels(), height, width);
  std::vector<double> mixed(static_cast<size_t>(image.width()));
  for (int c = 0; c < image.channels(); ++c) {
    for (int y = 0; y < height; ++y) {
      std::ranges::fill(mixed, 0.0);
      for (size_t k = 0; k < row_covers[y].weights.size(); ++k) {
        const float* in = image.row(c, row_covers[y].begin + static_cast<int>(k));
        const double weight = row_covers[y].weights[k];
        for (int x = 0; x < image.width(); ++x) mixed[x] += weight * in[x];
      }
      float* out = result.row(c, y);
      for (int x = 0; x < width; ++x) {
        double sum = 0;
        for (size_t k = 0; k < column_covers[x].weights.size(); ++k) {
          sum += column_covers[x].weights[k] * mixed[column_covers[x].begin + k];
        }
        out[x] = static_cast<float>(sum);
      }
    }
  }
  return result;
}

}  // namespace hsi4d
