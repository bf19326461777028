#include "core/process.h"

#include <cerrno>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <signal.h>
#include <thread>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "tests/support/temporary_folder.h"

namespace process_test {

using namespace hsi4d;
using Catch::Matchers::Message;
using hsi4d::test::TemporaryFolder;

TEST_CASE("a child does at a signal what is usual though its parent ignores it") {
  const auto before = std::signal(SIGINT, SIG_IGN);
  CHECK_THROWS_WITH(run_process({"sh", "-c", "kill -INT $$; echo ignored"}),
                    "sh: was ended by signal 2; it printed nothing");
  std::signal(SIGINT, before);
}

TEST_CASE("what a program prints comes back, and arguments are not those of a shell") {
  CHECK(run_process({"printf", "%s|", "a b", "$HOME", "\"; rm x"}) == "a b|$HOME|\"; rm x|");
}

TEST_CASE("a program reads what is written, more than a pipe holds") {
  ChildProcess count({"wc", "-c"});
  const std::vector<uint8_t> part(100000, 'x');
  for (int i = 0; i < 20; ++i) CHECK(count.write(part));
  CHECK(count.finish() == "2000000\n");
}

TEST_CASE("a program that fails is told with its status and what it printed") {
  CHECK_THROWS_MATCHES(run_process({"sh", "-c", "echo first; echo wrong >&2; exit 3"}), UserError,
                       Message("sh: ended with status 3:\nfirst\nwrong"));
  CHECK_THROWS_MATCHES(run_process({"false"}), UserError, Message("false: ended with status 1; it printed nothing"));
  CHECK_THROWS_MATCHES(run_process({"sh", "-c", "kill -9 $$"}), UserError,
                       Message("sh: was ended by signal 9; it printed nothing"));
  CHECK_THROWS_MATCHES(
      run_process({"hsi4d-no-such-program"}), UserError,
      Message("hsi4d-no-such-program: cannot be run: No such file or directory; is it installed, and in PATH?"));
}

TEST_CASE("the status of a program that fails is known as a number and a signal is none") {
  int status = -1;
  try {
    run_process({"sh", "-c", "exit 75"});
  } catch (const ProgramFailedError& error) {
    status = error.status();
  }
  CHECK(status == 75);
  bool is_status = false;
  try {
    run_process({"sh", "-c", "kill -9 $$"});
  } catch (const ProgramFailedError&) {
    is_status = true;
  } catch (const UserError&) {
  }
  CHECK_FALSE(is_status);
}

TEST_CASE("a program that stops reading is no signal to us") {
  ChildProcess child({"sh", "-c", "echo enough; exit 4"});
  const std::vector<uint8_t> part(1000000, 'x');
  bool is_read = true;
  for (int i = 0; i < 50 && is_read; ++i) is_read = child.write(part);
  CHECK_FALSE(is_read);
  CHECK_THROWS_MATCHES(child.finish(), UserError, Message("sh: ended with status 4:\nenough"));
}

TEST_CASE("a program that nobody waits for is ended") {
  const TemporaryFolder here;
  pid_t pid = 0;
  {
    ChildProcess child({"sh", "-c", "echo $$ > pid.tmp; mv pid.tmp pid; exec sleep 1000"});
    for (int i = 0; i < 2000 && !std::filesystem::exists("pid"); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    REQUIRE(std::filesystem::exists("pid"));
    std::ifstream("pid") >> pid;
    REQUIRE(pid > 1);
    CHECK(kill(pid, 0) == 0);  // it runs
  }
  CHECK(kill(pid, 0) == -1);  // it is gone, and waited for
  CHECK(errno == ESRCH);
}

TEST_CASE("programs are found as commands would start them") {
  const TemporaryFolder here;
  CHECK(find_program("sh").ends_with("/sh"));
  CHECK(find_program("no_such_program_hsi4d").empty());
  CHECK(find_program("").empty());
  here.write("tool", "#!/bin/sh\n");
  CHECK(find_program("./tool").empty());  // not executable yet
  std::filesystem::permissions("tool", std::filesystem::perms::owner_all);
  CHECK(find_program("./tool") == "./tool");
  CHECK(find_program("tool").empty());  // the current folder is not in PATH
  CHECK(find_program("./").empty());
}

namespace {

/// Whether a process whose number is in a file has ended: it is gone, or dead and not collected by init.
bool has_ended(const char* file) {
  int process = 0;
  std::ifstream(file) >> process;
  REQUIRE(process > 0);
  if (kill(process, 0) != 0) return true;
  std::ifstream stat("/proc/" + std::to_string(process) + "/stat");
  std::string number, name, state;
  stat >> number >> name >> state;
  return state.empty() || state == "Z";
}

/// The same after at most two seconds, in which a killed process goes.
bool ends(const char* file) {
  for (int i = 0; i < 100 && !has_ended(file); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  return has_ended(file);
}

}  // namespace

TEST_CASE("what a program has started in its group is ended when the program has ended") {
  const TemporaryFolder here;
  const std::string leaves = "sleep 60 & echo $! > child.txt; echo done";
  SECTION("by itself") { CHECK(run_process({"sh", "-c", leaves}) == "done\n"); }
  SECTION("by itself within limits") { CHECK(run_process({"sh", "-c", leaves}, ProcessLimits{}) == "done\n"); }
  SECTION("by a failure") { CHECK_THROWS_AS(run_process({"sh", "-c", leaves + "; exit 3"}), ProgramFailedError); }
  SECTION("and does not go when it is asked to") {
    run_process({"sh", "-c",
                 "(trap '' TERM; : > deaf; while :; do sleep 0.05; done) & echo $! > child.txt; "
                 "while ! test -e deaf; do sleep 0.01; done"});
  }
  SECTION("after that nobody waited for") {
    ChildProcess child({"sh", "-c", leaves + "; : > ready; wait"});
    for (int i = 0; i < 2000 && !std::filesystem::exists("ready"); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    REQUIRE(std::filesystem::exists("ready"));
  }
  CHECK(ends("child.txt"));
}

TEST_CASE("what a program has started has time to go after the program itself has gone") {
  const TemporaryFolder here;
  const std::string child =
      "(trap 'sleep 0.1; echo tidy > tidied; exit' TERM; : > ready; while :; do sleep 0.05; done)";
  const std::string waits = " while ! test -e ready; do sleep 0.01; done";
  SECTION("by itself") { run_process({"sh", "-c", child + " &" + waits}); }
  SECTION("when it was asked to") {
    CHECK_FALSE(run_process({"sh", "-c", child + " & wait"},
                            {.seconds = 0, .stop_requested = [] { return std::filesystem::exists("ready"); }}));
  }
  CHECK(std::filesystem::exists("tidied"));
}

TEST_CASE("a program that takes too long is ended with all that it has started") {
  const TemporaryFolder here;
  const auto begin = std::chrono::steady_clock::now();
  CHECK_THROWS_MATCHES(run_process({"sh", "-c", "echo begun; sleep 60 & echo $! > child.txt; wait"}, {.seconds = 0.3}),
                       UserError, Message("sh: was ended after 0.3 seconds, which is all the time it has:\nbegun"));
  CHECK(std::chrono::steady_clock::now() - begin < std::chrono::seconds(20));
  CHECK(ends("child.txt"));
  CHECK(run_process({"sh", "-c", "echo done"}, ProcessLimits{.seconds = 30}) == "done\n");
  CHECK_THROWS_MATCHES(run_process({"sh", "-c", "echo why >&2; exit 4"}, ProcessLimits{}), UserError,
                       Message("sh: ended with status 4:\nwhy"));
}

TEST_CASE("a program is ended when it is asked for, even one that does not want to") {
  int asked = 0;
  const auto result = run_process({"sh", "-c", "trap '' TERM; while true; do sleep 0.05; done"},
                                  {.seconds = 0, .stop_requested = [&asked] { return ++asked > 3; }});
  CHECK_FALSE(result.has_value());
}

}  // namespace process_test
