#include "core/memory.h"

#include <catch2/catch.hpp>

#include "tests/support/temporary_folder.h"

namespace memory_test {

using namespace hsi4d;
using namespace hsi4d::test;

TEST_CASE("a process's own memory is told") {
  CHECK(peak_memory_bytes() > (1 << 20));
  CHECK(peak_memory_bytes(::getpid()) > (1 << 20));
  CHECK(peak_memory_bytes(1 << 30) == 0);  // there is none
  CHECK(available_memory_mb() > 0);
}

TEST_CASE("memory is what the kernel has to give") {
  const TemporaryFolder here;
  here.write("proc/meminfo", "MemTotal:  16777216 kB\nMemAvailable:  8388608 kB\n");
  CHECK(available_memory_mb(".") == 8192);
  here.write("proc/self/cgroup", "0::/user.slice\n");
  here.write("sys/fs/cgroup/user.slice/memory.max", "max\n");
  here.write("sys/fs/cgroup/user.slice/memory.current", "1048576\n");
  CHECK(available_memory_mb(".") == 8192);
}

TEST_CASE("memory is what control groups leave beside files that can be dropped") {
  const TemporaryFolder here;
  here.write("proc/meminfo", "MemAvailable:  8388608 kB\n");
  here.write("proc/self/cgroup", "0::/a/b\n");
  here.write("sys/fs/cgroup/a/memory.max", "1073741824\n");  // 1024 MB, of the group that ours is in
  here.write("sys/fs/cgroup/a/memory.current", "943718400\n");
  here.write("sys/fs/cgroup/a/memory.stat", "anon 7\ninactive_file 104857600\n");
  here.write("sys/fs/cgroup/a/b/memory.max", "max\n");
  here.write("sys/fs/cgroup/a/b/memory.current", "4096\n");
  CHECK(available_memory_mb(".") == 224);
  here.write("sys/fs/cgroup/memory.max", "536870912\n");  // of a container, whose own group this is
  here.write("sys/fs/cgroup/memory.current", "536870912\n");
  CHECK(available_memory_mb(".") == 0);
}

TEST_CASE("control groups of version 1 are asked too") {
  const TemporaryFolder here;
  here.write("proc/meminfo", "MemAvailable:  8388608 kB\n");
  here.write("proc/self/cgroup", "5:cpu:/x\n4:memory:/docker/1\n");
  here.write("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");
  here.write("sys/fs/cgroup/memory/memory.usage_in_bytes", "1048576\n");
  here.write("sys/fs/cgroup/memory/docker/1/memory.limit_in_bytes", "524288000\n");
  here.write("sys/fs/cgroup/memory/docker/1/memory.usage_in_bytes", "419430400\n");
  here.write("sys/fs/cgroup/memory/docker/1/memory.stat", "inactive_file 1\ntotal_inactive_file 10485760\n");
  CHECK(available_memory_mb(".") == 110);
}

}  // namespace memory_test
