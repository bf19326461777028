// A topic of `hsi4d bench`: what it is called, and what it measures. bench/list.h has all of them.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "pipelines/cli/program_commands.h"

namespace hsi4d::cli {

/// What a kernel is asked.
struct BenchOptions {
  std::vector<std::string> workloads;  ///< empty: all
  int threads = 1;
  int repeats = 9;
  std::string json;  ///< path to write one JSON object a measurement to; empty: none
};

/// What a topic that runs a config is asked.
struct BenchConfigOptions {
  std::filesystem::path config;
  std::vector<std::string> overrides;
  std::string json;  ///< file for the measurements; empty: none
  std::string plot;  ///< file for the SVG; empty: none
};

/// What was measured: for people, and for programs.
struct BenchText {
  std::string table, json;
};

/// A topic is a kernel and has `measure`, or has `add`.
struct BenchTopic {
  const char *name, *summary;
  /// Measures a kernel; `hsi4d bench` without a topic does so with all of them. Its options are BenchOptions.
  BenchText (*measure)(const BenchOptions& options) = nullptr;
  bool has_threads = true;  ///< of a kernel: there is --threads
  /// Adds options to the topic's command, and what it does.
  void (*add)(CLI::App& command, Program& program) = nullptr;
};

/// Measures kernels and writes the file that is asked for. Returns their tables.
/// Throws UserError for a workload that is not known.
std::string run_kernels(const std::vector<BenchTopic>& kernels, const BenchOptions& options);

/// With one decimal; a dash for nothing.
std::string tenths(double value);

/// What shares of the peak are of; nothing where none was measured.
std::string peak_line(double peak_per_s);

// Options that several topics have.
void add_workload(CLI::App& command, std::vector<std::string>& names, const char* what);
void add_thread_count(CLI::App& command, int& threads, const char* usual);
void add_repeats(CLI::App& command, int& repeats);
void add_json(CLI::App& command, std::string& file);
/// --config, --set, --plot, --json. @param what  the config is; @param usual  which it is where none is given
void add_config(CLI::App& command, BenchConfigOptions& options, const std::string& what, const std::string& usual);

/// Throws UserError for a name that is none of the topic's.
void check_workloads(const char* topic, const std::vector<std::string>& wanted, const std::vector<std::string>& known);

/// The workloads that are wanted by name, in the order of all; all where no name is given. Throws as check_workloads.
template <class Workload, std::size_t N>
std::vector<Workload> chosen_workloads(const char* topic, const std::vector<std::string>& wanted,
                                       const std::array<Workload, N>& all) {
  std::vector<std::string> known;
  std::vector<Workload> chosen;
  for (const Workload& workload : all) {
    known.emplace_back(workload.name);
    bool is_wanted = wanted.empty();
    for (const std::string& name : wanted) is_wanted = is_wanted || name == known.back();
    if (is_wanted) chosen.push_back(workload);
  }
  check_workloads(topic, wanted, known);
  return chosen;
}

}  // namespace hsi4d::cli
