// The planar float image, its row padding, and the conversions that files and metrics need.
#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <span>
#include <string>
#include <vector>

#include "core/types.h"

namespace hsi4d {

/// Allocates at multiples of kAlignment.
template <class T>
struct AlignedAllocator {
  using value_type = T;
  AlignedAllocator() = default;
  template <class U>
  AlignedAllocator(const AlignedAllocator<U>&) {}
  T* allocate(size_t count) {
    return static_cast<T*>(::operator new (count * sizeof(T), std::align_val_t{kAlignment}));
  }
  void deallocate(T* p, size_t) { ::operator delete (p, std::align_val_t{kAlignment}); }
  bool operator==(const AlignedAllocator&) const { return true; }
};

/// Sizes above which a reader refuses an image before it allocates: a wrong header can claim anything.
struct ImageLimits {
  int max_side = 1 << 16;                ///< pixels, width and height
  int64_t max_bytes = int64_t{4} << 30;  ///< of the float image in memory
};

/// Throws DataError naming the file, the size and the limit when an image of this size is beyond the limits.
void check_image_size(const std::string& name, int64_t channels, int64_t height, int64_t width,
                      const ImageLimits& limits);

/// Float image, planar: [channels][height][row_stride()], 64-byte aligned rows, padding zero.
///
/// Code that writes through row() or data() leaves the padding at zero.
class Image {
 public:
  /// No pixels.
  Image() = default;

  /// All zero. Throws InternalError for a negative size or one beyond 2^48 numbers.
  Image(int channels, int height, int width);

  int channels() const { return channels_; }
  int height() const { return height_; }
  int width() const { return width_; }
  bool empty() const { return values_.empty(); }

  /// Numbers from one row to the next: padded_row<float>(width()).
  int64_t row_stride() const { return row_stride_; }
  /// Numbers from one plane to the next.
  int64_t plane_stride() const { return row_stride_ * height_; }

  /// Row y of channel c: width() numbers, then padding.
  float* row(int c, int y) { return values_.data() + c * plane_stride() + y * row_stride_; }
  const float* row(int c, int y) const { return values_.data() + c * plane_stride() + y * row_stride_; }

  /// Channel c at row y (from the top), column x.
  float& operator()(int c, int y, int x) { return row(c, y)[x]; }
  float operator()(int c, int y, int x) const { return row(c, y)[x]; }

  /// Everything, padding included.
  std::span<float> data() { return values_; }
  std::span<const float> data() const { return values_; }

  /// Same sizes, same bits apart from the sign of zero; NaN differs from itself.
  bool operator==(const Image&) const = default;

 private:
  int channels_ = 0;
  int height_ = 0;
  int width_ = 0;
  int64_t row_stride_ = 0;
  std::vector<float, AlignedAllocator<float>> values_;
};

/// Planar from interleaved.
///
/// @param values  [height,width,channels], as npz files hold images
/// Throws InternalError when the count of values differs from the product of the sizes.
Image from_interleaved(std::span<const float> values, int height, int width, int channels);

/// Interleaved from planar: [height,width,channels], no padding.
std::vector<float> to_interleaved(const Image& image);

/// `count` channels from `first` on; take_channels(image, 0, 3) leaves out alpha. Throws InternalError outside the
/// image.
Image take_channels(const Image& image, int first, int count);

/// The part whose first pixel is (row top, column left). Throws InternalError where it leaves the image.
Image crop(const Image& image, int top, int left, int height, int width);

/// Another size by area: a result pixel is the mean of the source over the rectangle that it covers.
///
///   out(i,j) = ∫∫ in / area,   rows [i H/h, (i+1) H/h), columns [j W/w, (j+1) W/w)
///
/// Exact weights (integer overlaps), sums in double; the image's mean is kept. Meant for reduction (an image rendered
/// at twice the size); an enlargement repeats pixels.
///
/// @param height, width  pixels, > 0
/// Throws InternalError for an empty image or size.
Image resize_area(const Image& image, int height, int width);

}  // namespace hsi4d
