// Errors, and checks that print both values.
#pragma once

#include <sstream>
#include <stdexcept>
#include <string>
#include <version>

#ifdef __cpp_lib_source_location
#include <source_location>
#else  // clang 14 with g++ 12's library, which the fuzz targets are built with
#include <experimental/source_location>
#endif

namespace hsi4d {

/// The user's mistake (a command line, a config, a missing file): the program prints the message and exits with 2.
class UserError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A file's content is wrong. The message names the file and the position. Exit status 2.
class DataError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Our bug, or a misuse of the library by code. Exit status 3.
class InternalError : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

/// A place in the source; taken as a defaulted last argument so that it names the caller.
#ifdef __cpp_lib_source_location
using Source = std::source_location;
#else
using Source = std::experimental::source_location;
#endif

/// "file.cpp:12", the file without its folders.
std::string source_name(const Source& where);

namespace detail {
[[noreturn]] void fail_check(const char* condition, const std::string& values, const Source& where);

template <class A, class B>
std::string both_values(const A& a, const B& b) {
  std::ostringstream text;
  text << a << " against " << b;
  return text.str();
}
}  // namespace detail

}  // namespace hsi4d

/// Throws InternalError naming the condition and the source line unless `condition` holds.
#define HSI4D_CHECK(condition, message) \
  (static_cast<bool>(condition) ? void() : ::hsi4d::detail::fail_check(#condition, (message), ::hsi4d::Source::current()))

/// As HSI4D_CHECK for a == b; the message holds both values.
#define HSI4D_CHECK_EQ(a, b)                                                                         \
  ((a) == (b) ? void()                                                                               \
              : ::hsi4d::detail::fail_check(#a " == " #b, ::hsi4d::detail::both_values((a), (b)), \
                                            ::hsi4d::Source::current()))
