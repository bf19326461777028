#include "bench/command.h"

#include <CLI/CLI.hpp>

#include "bench/list.h"
#include "core/check.h"
#include "core/text.h"
#include "pipelines/cli/other_programs.h"

namespace hsi4d::cli {
namespace {

std::vector<BenchTopic> bench_topics() {
  return {
#define HSI4D_BENCH_TOPIC(name) name##_topic(),
      HSI4D_BENCH_TOPICS
#undef HSI4D_BENCH_TOPIC
  };
}

std::vector<BenchTopic> bench_kernels() {
  std::vector<BenchTopic> kernels;
  for (const BenchTopic& topic : bench_topics()) {
    if (topic.measure != nullptr) kernels.push_back(topic);
  }
  return kernels;
}

/// "rasterize, skinning, color_net and tape".
std::string kernel_names() {
  std::vector<std::string> names;
  for (const BenchTopic& kernel : bench_kernels()) names.emplace_back(kernel.name);
  const std::string last = names.back();
  names.pop_back();
  return joined(names) + " and " + last;
}

void add_topic(CLI::App& bench, const BenchTopic& topic, Program& program) {
  CLI::App& command = *bench.add_subcommand(topic.name, topic.summary);
  if (topic.add != nullptr) return topic.add(command, program);
  BenchOptions& options = program.options<BenchOptions>();
  add_workload(command, options.workloads, "workloads");
  if (topic.has_threads) add_thread_count(command, options.threads, "1");
  add_repeats(command, options.repeats);
  add_json(command, options.json);
  run_when_chosen(command, program, [topic, &options] { return run_kernels({topic}, options); });
}

}  // namespace

std::string bench_kernels_command(const BenchOptions& options) { return run_kernels(bench_kernels(), options); }

void add_bench(CLI::App& app, Program& program) {
  BenchOptions& options = program.options<BenchOptions>();
  CLI::App& bench = *app.add_subcommand(kBenchProgram.command,
                                        std::string(kBenchProgram.summary) + ". Without a topic: " + kernel_names());
  add_thread_count(bench, options.threads, "1");
  add_repeats(bench, options.repeats);
  add_json(bench, options.json);
  for (const BenchTopic& topic : bench_topics()) add_topic(bench, topic, program);
  bench.callback([&] {
    if (!program.run) program.run = [&options] { return bench_kernels_command(options); };
    const auto is_given = [&bench](const char* option) { return bench.count(option) > 0; };
    if (!bench.get_subcommands().empty() && (is_given("--threads") || is_given("--repeats") || is_given("--json")))
      throw UserError("hsi4d bench: options stand behind the topic, which has its own");
  });
}

}  // namespace hsi4d::cli
