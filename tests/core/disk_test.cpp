#include "core/disk.h"

#include <filesystem>

#include <catch2/catch.hpp>

#include "tests/support/temporary_folder.h"

namespace disk_test {

using namespace hsi4d;
using namespace hsi4d::test;

TEST_CASE("temporary files of a folder are removed, and nothing else") {
  const TemporaryFolder here;
  for (const char* name : {"a/b.json.1-0.tmp", "a/.tmp", "a/b.json", "a/b.tmp.json", "a/c/d.1-0.tmp"})
    here.write(name, "{");
  remove_temporary_files("a");
  CHECK_FALSE(std::filesystem::exists("a/b.json.1-0.tmp"));
  CHECK_FALSE(std::filesystem::exists("a/.tmp"));
  for (const char* name : {"a/b.json", "a/b.tmp.json", "a/c/d.1-0.tmp"}) CHECK(std::filesystem::exists(name));
  remove_temporary_files("nowhere");
}

TEST_CASE("files that are put on the disk stay as they are") {
  const TemporaryFolder here;
  here.write("a/b/c.txt", "text");
  sync_to_disk("a");
  sync_to_disk("a/b/c.txt");
  sync_to_disk("nowhere");
  CHECK(file_text("a/b/c.txt") == "text");
}

}  // namespace disk_test
