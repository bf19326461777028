#include "bench/topic.h"

#include <algorithm>

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/file.h"
#include "core/formatted.h"
#include "core/suggest.h"
#include "core/text.h"
#include "pipelines/cli/options.h"

namespace hsi4d::cli {

std::string run_kernels(const std::vector<BenchTopic>& kernels, const BenchOptions& options) {
  BenchText all;
  for (const BenchTopic& kernel : kernels) {
    const BenchText text = kernel.measure(options);
    all.table += (all.table.empty() ? "" : "\n") + text.table;
    all.json += text.json;
  }
  if (!options.json.empty()) write_text_file(options.json, all.json);
  return all.table;
}

std::string tenths(double value) { return value > 0 ? formatted("%.1f", value) : "-"; }

std::string peak_line(double peak_per_s) {
  if (!(peak_per_s > 0)) return "";
  return formatted("peak %%: of the %.1f G multiply-adds a second that were measured beside it\n", 1e-9 * peak_per_s);
}

void add_workload(CLI::App& command, std::vector<std::string>& names, const char* what) {
  command.add_option("--workload", names, std::string("Only these ") + what + "; default: all");
}

void add_thread_count(CLI::App& command, int& threads, const char* usual) {
  command.add_option("--threads", threads, std::string("Threads; default: ") + usual)->check(CLI::Range(1, 1024));
}

void add_repeats(CLI::App& command, int& repeats) {
  command.add_option("--repeats", repeats, "Runs of each, of which the median is told; default: 9")
      ->check(CLI::Range(1, 1000));
}

void add_json(CLI::App& command, std::string& file) {
  command.add_option("--json", file, "File for the measurements, one JSON object a line")->type_name("F");
}

void add_config(CLI::App& command, BenchConfigOptions& options, const std::string& what, const std::string& usual) {
  options.config = usual;
  command.add_option("--config", options.config, what + "; default: " + usual)->type_name("F.json");
  add_overrides(command, options.overrides);
  command.add_option("--plot", options.plot, "File for a picture")->type_name("F.svg");
  add_json(command, options.json);
}

void check_workloads(const char* topic, const std::vector<std::string>& wanted, const std::vector<std::string>& known) {
  for (const std::string& name : wanted) {
    if (std::find(known.begin(), known.end(), name) == known.end())
      throw UserError(std::string("hsi4d bench ") + topic + ": no workload \"" + name + "\"; known: " + joined(known) +
                      did_you_mean(name, known));
  }
}

}  // namespace hsi4d::cli
