// Aligned memory that grows by half and never shrinks, so that a steady iteration allocates nothing.
#pragma once

#include <algorithm>
#include <new>
#include <span>
#include <type_traits>

#include "core/types.h"

namespace hsi4d {

/// Array of trivial elements, aligned to kAlignment. Growing does not keep the content; new memory is uninitialised.
template <class T>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T>, "Buffer holds plain numbers and structs of them");

 public:
  Buffer() = default;
  Buffer(Buffer&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)),
        size_(std::exchange(other.size_, 0)),
        capacity_(std::exchange(other.capacity_, 0)) {}
  Buffer& operator=(Buffer&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
    return *this;
  }
  ~Buffer() { release(); }

  /// Makes room for `size` elements. The old content is lost when the capacity had to grow.
  void resize(Index size) {
    if (size > capacity_) {
      const Index capacity = std::max(size, capacity_ + capacity_ / 2);
      release();
      data_ =
          static_cast<T*>(::operator new(static_cast<std::size_t>(capacity) * sizeof(T), std::align_val_t(kAlignment)));
      capacity_ = capacity;
    }
    size_ = size;
  }
  T* data() { return data_; }
  const T* data() const { return data_; }
  Index size() const { return size_; }
  Index capacity_bytes() const { return capacity_ * static_cast<Index>(sizeof(T)); }
  T& operator[](Index i) { return data_[i]; }
  const T& operator[](Index i) const { return data_[i]; }
  std::span<T> span() { return {data_, static_cast<std::size_t>(size_)}; }
  std::span<const T> span() const { return {data_, static_cast<std::size_t>(size_)}; }

 private:
  void release() {
    ::operator delete(data_, std::align_val_t(kAlignment));
    data_ = nullptr;
    size_ = capacity_ = 0;
  }
  T* data_ = nullptr;
  Index size_ = 0;
  Index capacity_ = 0;
};

}  // namespace hsi4d
