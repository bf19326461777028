// The program as it serves: who reaches it, what it says, how it ends.
#include <arpa/inet.h>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <iterator>
#include <sstream>
#include <sys/socket.h>

#include <catch2/catch.hpp>

#include "tests/support/program.h"
#include "tests/support/running_program.h"

namespace server_test {

using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::StartsWith;

namespace {

/// A connection to a port of this machine; -1 where nobody listens.
int connected_to(int port) {
  const int connection = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (::connect(connection, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0) return connection;
  ::close(connection);
  return -1;
}

/// Sends text and reads until the server closes.
std::string reply_to(int port, const std::string& request) {
  const int connection = connected_to(port);
  REQUIRE(connection >= 0);
  REQUIRE(::send(connection, request.data(), request.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(request.size()));
  std::string reply;
  char part[4096];
  for (ssize_t got = 0; (got = ::recv(connection, part, sizeof(part), 0)) > 0;)
    reply.append(part, static_cast<std::size_t>(got));
  ::close(connection);
  return reply;
}

std::string request_of(const std::string& line, const std::string& host) {
  return line + " HTTP/1.1\r\nHost: " + host + "\r\n\r\n";
}

/// The port that a program tells, waited for.
int port_of(RunningProgram& program) {
  const std::string before = "http://127.0.0.1:";
  while (program.is_running() && program.text().find('\n') == std::string::npos) ::usleep(1000);
  INFO(program.text());
  REQUIRE_THAT(program.text(), StartsWith(before));
  return std::stoi(program.text().substr(before.size()));
}

/// The addresses, as the kernel writes them, at which somebody listens at a port.
std::vector<std::string> listening_addresses(int port) {
  std::ostringstream wanted;
  wanted << std::uppercase << std::hex << std::setw(4) << std::setfill('0') << port;
  std::vector<std::string> addresses;
  for (const char* table : {"/proc/net/tcp", "/proc/net/tcp6"}) {
    std::ifstream lines(table);
    for (std::string number, local, remote, state, rest; lines >> number >> local >> remote >> state;) {
      std::getline(lines, rest);
      const std::size_t colon = local.rfind(':');
      if (state == "0A" && local.substr(colon + 1) == wanted.str()) addresses.push_back(local.substr(0, colon));
    }
  }
  return addresses;
}

void make_run(const TemporaryFolder& here) {
  here.write("runs/a/config.resolved.json", "{}");
  here.write("runs/a/status.json", R"({"state": "running"})");
}

}  // namespace

TEST_CASE("watch serves this machine alone, until SIGINT or SIGTERM, and ends well") {
  const TemporaryFolder here;
  make_run(here);
  for (const int signal : {SIGINT, SIGTERM}) {
    std::filesystem::remove("running.txt");
    RunningProgram program({"watch", "runs"});
    const int port = port_of(program);
    const std::string host = "127.0.0.1:" + std::to_string(port);
    CHECK(listening_addresses(port) == std::vector<std::string>{"0100007F"});

    const std::string page = reply_to(port, request_of("GET /", host));
    CHECK_THAT(page, StartsWith("HTTP/1.1 200"));
    CHECK_THAT(page, Contains("Content-Security-Policy: default-src 'none'"));
    CHECK_THAT(page, Contains("X-Content-Type-Options: nosniff"));
    CHECK_THAT(reply_to(port, request_of("GET /runs", host)), Contains(R"("id": "a")"));
    CHECK_THAT(reply_to(port, request_of("GET /run?run=a", "localhost:1")), Contains(R"("state": "running")"));

    CHECK_THAT(reply_to(port, request_of("GET /runs", "evil.example")), StartsWith("HTTP/1.1 403"));
    CHECK_THAT(reply_to(port, "GET /runs HTTP/1.0\r\n\r\n"), StartsWith("HTTP/1.1 403"));
    CHECK_THAT(reply_to(port, request_of("POST /runs", host)), StartsWith("HTTP/1.1 405"));
    CHECK_THAT(reply_to(port, request_of("POST /runs", host)), Contains("Allow: GET"));
    for (const char* path : {"/../runs/a/status.json", "/%2e%2e/runs/a/status.json", "/runs/a/status.json",
                             "/run?run=..%2Fruns%2Fa", "/image?run=a&frame=..%2F1&kind=render"}) {
      INFO(path);
      CHECK_THAT(reply_to(port, request_of(std::string("GET ") + path, host)), StartsWith("HTTP/1.1 4"));
    }
    CHECK_THAT(reply_to(port, "no HTTP\r\n\r\n"), StartsWith("HTTP/1.1 400"));

    const int silent = connected_to(port);  // who says nothing does not keep it
    program.signal_at(signal, [] { return true; });
    ::close(silent);
    CHECK(program.result() == 0);
    CHECK(program.text() == "http://" + host + "/ shows runs until Ctrl-C\n");
    CHECK(connected_to(port) == -1);
  }
  CHECK(std::distance(std::filesystem::directory_iterator("runs/a"), {}) == 2);  // it writes nothing, and no lock
}

TEST_CASE("a port that is taken is refused where it is asked for, else another one is taken") {
  const TemporaryFolder here;
  make_run(here);
  RunningProgram first({"watch", "runs"});
  const int port = port_of(first);
  const ProgramResult refused = run_hsi4d({"watch", "runs", "--port", std::to_string(port)});
  CHECK(refused.status == 2);
  CHECK_THAT(refused.err, StartsWith("hsi4d watch: --port " + std::to_string(port) + " cannot be listened at"));
  std::filesystem::remove("running.txt");
  RunningProgram second({"watch", "runs"});
  CHECK(port_of(second) != port);
}

TEST_CASE("watch tells what is wrong with its arguments") {
  const TemporaryFolder here;
  CHECK(run_hsi4d({"watch", "nowhere"}).err == "nowhere: there is no such folder\n");
  here.write("other/notes.txt", "");
  const ProgramResult other = run_hsi4d({"watch", "other"});
  CHECK(other.status == 2);
  CHECK(other.err == "other: holds no run, sweep or chain\n");
  for (const char* port : {"0", "65536", "x"}) CHECK(run_hsi4d({"watch", "other", "--port", port}).status == 2);
  CHECK(run_hsi4d({"watch"}).status == 2);
}

}  // namespace server_test
