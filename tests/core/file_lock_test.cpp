#include "core/file_lock.h"

#include <filesystem>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "tests/support/temporary_folder.h"

namespace file_lock_test {

using namespace hsi4d;
using namespace hsi4d::test;

TEST_CASE("a lock is one process's, or one holder's within it") {
  const TemporaryFolder here;
  CHECK_FALSE(is_file_locked("a"));
  {
    FileLock lock("a"), other("a");
    CHECK_FALSE(is_file_locked("a"));
    CHECK(lock.take() == FileLock::State::kHeld);
    CHECK(other.take() == FileLock::State::kBusy);
    CHECK(is_file_locked("a"));
    int told = 0, asked = 0;
    CHECK(other.wait([&asked] { return ++asked == 3; }, [&told] { ++told; }, std::chrono::milliseconds(1)) ==
          FileLock::State::kBusy);
    CHECK(told == 1);
    CHECK(asked == 3);
    const FileLock moved = std::move(lock);
    CHECK(is_file_locked("a"));
  }
  CHECK_FALSE(is_file_locked("a"));
  CHECK_THROWS_WITH(FileLock("nowhere/a"), "nowhere/a: cannot be written: No such file or directory");
}

TEST_CASE("a lock knows whether its file is still the one of that name") {
  const TemporaryFolder here;
  FileLock lock("a");
  CHECK(lock.is_in_place());
  std::filesystem::remove("a");
  CHECK_FALSE(lock.is_in_place());
  here.write("a", "");
  CHECK_FALSE(lock.is_in_place());
}

}  // namespace file_lock_test
