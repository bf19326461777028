// `hsi4d watch`: a page with curves, frames and the table of runs, while they go on.
#include <cstdio>
#include <memory>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/list.h"
#include "pipelines/watch/answers.h"
#include "pipelines/watch/watched.h"

namespace hsi4d::cli {

namespace {

constexpr int kWatchPort = 8417;  // where it is free: an address that stays open in a browser

struct WatchOptions {
  std::string path;         ///< PATH
  std::optional<int> port;  ///< --port N
};

using OpenedServer = std::unique_ptr<LocalServer, void (*)(LocalServer*)>;

/// Listens at the port that is asked for; else at the usual one, or any where that is taken.
OpenedServer open_server(const WatchOptions& o) {
  const ServerLibrary& library = server_library();
  const auto answer = [path = o.path](const ServedRequest& request) { return watch_answer(path, request); };
  OpenedServer server(library.open(o.port.value_or(kWatchPort), answer), library.close);
  if (!server && !o.port) server.reset(library.open(0, answer));
  if (!server)
    throw UserError("hsi4d watch: --port " + std::to_string(o.port.value_or(0)) +
                    " cannot be listened at: another program does, or the system reserves it");
  return server;
}

/// Serves until a signal; returns nothing to print. Throws UserError for a path without runs and a port that is taken.
std::string watch_command(const WatchOptions& o) {
  check_watched(o.path);
  const InterruptWatch watch;
  const OpenedServer server = open_server(o);
  std::printf("http://127.0.0.1:%d/ shows %s until Ctrl-C\n", server_library().port(*server), o.path.c_str());
  std::fflush(stdout);
  server_library().serve(*server, InterruptWatch::requested);
  return "";
}

}  // namespace

void add_watch(CLI::App& app, Program& program) {
  WatchOptions& o = program.options<WatchOptions>();
  CLI::App* command =
      app.add_subcommand("watch", "A local page with curves, frames and the table of runs while they go on");
  command->add_option("PATH", o.path, "A run, a sweep, a chain, or a folder of runs")->required();
  command
      ->add_option("--port", o.port,
                   "Where this machine finds the page; default: " + std::to_string(kWatchPort) + ", or any free one")
      ->check(CLI::Range(1, 65535))
      ->type_name("N");
  run_when_chosen(*command, program, [&] { return watch_command(o); });
}

}  // namespace hsi4d::cli
