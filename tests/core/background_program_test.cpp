#include "core/background_program.h"

#include <chrono>
#include <csignal>
#include <string>
#include <thread>

#include <catch2/catch.hpp>

#include "core/process.h"
#include "tests/support/temporary_folder.h"

namespace background_program_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

ProgramEnd wait_for(BackgroundProgram& program) {
  while (true) {
    if (const auto end = program.ended()) return *end;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
}

}  // namespace

TEST_CASE("a background program's output is appended, and its end told") {
  const TemporaryFolder here;
  here.write("out.txt", "before\n");
  BackgroundProgram program({"sh", "-c", "echo out; echo err >&2; cat; exit 7"}, "out.txt");
  const ProgramEnd end = wait_for(program);
  CHECK(end.status == 7);
  CHECK(end.signal == 0);
  CHECK(file_text("out.txt") == "before\nout\nerr\n");
  CHECK(program.ended()->status == 7);
}

TEST_CASE("a background program can be interrupted though its owner ignores that") {
  const TemporaryFolder here;
  const auto before = std::signal(SIGINT, SIG_IGN);
  BackgroundProgram program({"sleep", "30"}, "out.txt");
  program.send(SIGINT);
  CHECK(wait_for(program).signal == SIGINT);
  std::signal(SIGINT, before);
}

TEST_CASE("a background program whose end is thrown away has ended") {
  const TemporaryFolder here;
  const auto before = std::signal(SIGCHLD, SIG_IGN);
  BackgroundProgram program({"true"}, "out.txt");
  const ProgramEnd end = wait_for(program);
  std::signal(SIGCHLD, before);
  CHECK_FALSE(end.is_known);
}

TEST_CASE("a background program's memory is its own") {
  const TemporaryFolder here;
  const std::vector<char> ours(std::size_t{64} << 20U, 1);  // of which a shell that we start has nothing
  BackgroundProgram program({"sh", "-c", "while [ ! -e go ]; do sleep 0.01; done"}, "out.txt");
  const double early = program.peak_mb();
  here.write("go", "");
  const ProgramEnd end = wait_for(program);
  CHECK(early > 0);
  CHECK(early < 64);
  CHECK(end.peak_mb < 64);
  CHECK(ours[1] == 1);
}

TEST_CASE("a background program gets signals, and goes with its owner") {
  const TemporaryFolder here;
  BackgroundProgram program({"sleep", "60"}, "out.txt");
  CHECK_FALSE(program.ended());
  program.send(SIGTERM);
  CHECK(wait_for(program).signal == SIGTERM);
  const auto begin = std::chrono::steady_clock::now();
  { const BackgroundProgram killed({"sleep", "60"}, "out.txt"); }
  CHECK(std::chrono::steady_clock::now() - begin < std::chrono::seconds(10));
}

TEST_CASE("a background program that cannot be started is told") {
  const TemporaryFolder here;
  CHECK_THROWS_AS(BackgroundProgram({"no-such-program-here"}, "out.txt"), ProgramNotStartedError);
  CHECK_THROWS_WITH(BackgroundProgram({"true"}, "nowhere/out.txt"),
                    Catch::Matchers::StartsWith("nowhere/out.txt: cannot be written: "));
}

}  // namespace background_program_test
