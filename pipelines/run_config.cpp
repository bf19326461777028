#include "pipelines/run_config.h"

#include "core/config_file.h"

namespace hsi4d {
namespace {

constexpr int kMostIterations = 1000000;
constexpr int kMostThreads = 1024;
/// The largest whole number that every JSON tool keeps (RFC 8259, section 6).
constexpr std::int64_t kLargestSeed = (std::int64_t{1} << 53) - 1;

std::vector<ConfigKey<LossSettings>> loss_keys(const std::vector<LossDescription>& losses) {
  std::vector<ConfigKey<LossSettings>> keys;
  for (const LossDescription& loss : losses)
    keys.push_back({loss.name, loss.summary, {1, loss.defaults, loss.describe_settings}});
  return keys;
}

}  // namespace

void describe(ConfigFields& f, OptimizerSettings& s) {
  f.choice("kind", s.kind, kOptimizerKinds, "The method");
  f.number("beta1", s.beta1, {.min = 0, .below = 1}, "Decay of the first moment");
  f.number("beta2", s.beta2, {.min = 0, .below = 1}, "Decay of the second moment");
  f.number("eps", s.eps, {.above = 0, .max = 1}, "Added to the root of the second moment");
}

void describe(ConfigFields& f, ParameterGroupSettings& s) {
  const IntegerRange iterations = {.min = 0, .max = kMostIterations};
  f.number("lr", s.lr, {.min = 0, .max = 1000}, "Learning rate").required();
  f.integer("from", s.from, iterations, "First iteration in which the group moves");
  f.optional(s.until, [iterations](ConfigFields& inner, int& until) {
    inner.integer("until", until, iterations,
                  "First iteration in which it no longer moves; null: the end of the stage");
  });
  f.integer("every", s.every, {.min = 1, .max = kMostIterations}, "It moves in every this many-th iteration");
  f.rule("until", [&s]() -> std::string {
    if (!s.until || *s.until > s.from) return "";
    return std::to_string(*s.until) + " is not after from, which is " + std::to_string(s.from) +
           "; the group would never move";
  });
}

void describe(ConfigFields& f, StageSettings& s, const std::vector<LossDescription>& losses) {
  f.integer("iterations", s.iterations, {.min = 1, .max = kMostIterations}, "Steps of the optimiser").required();
  f.map("optimize", s.optimize, "What moves: parameter groups by name");
  f.map("losses", s.losses, loss_keys(losses), "What is made small: loss terms by name; their weighted sum counts");
  f.object("optimizer", s.optimizer, "How gradients become steps");
}

void describe(ConfigFields& f, RunConfig& s, const std::vector<LossDescription>& losses) {
  f.integer("seed", s.seed, {.min = 0, .max = kLargestSeed}, "Seed of everything that is random");
  f.integer("threads", s.threads, {.min = 0, .max = kMostThreads},
            "Threads; 0: one a core. Results do not depend on it");
  f.object("render", s.render, "How Gaussians become pixels");
  f.object("synthetic", s.synthetic, "What hsi4d synth makes: a dataset with exact ground truth");
  f.map("stages", s.stages, "The stages of the run by name, in the order in which they run",
        [losses](ConfigFields& inner, StageSettings& stage) { describe(inner, stage, losses); });
}

RunConfig read_run_config(const ConfigValue& tree, const std::vector<LossDescription>& losses,
                          ConfigProblems& problems) {
  RunConfig config;
  ConfigFields fields;
  describe(fields, config, losses);
  read_config(tree, fields, problems);
  problems.throw_if_any();
  return config;
}

RunConfig load_run_config(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                          const std::vector<LossDescription>& losses) {
  ConfigProblems problems;
  const ConfigValue tree = load_config(file, overrides, problems);
  return read_run_config(tree, losses, problems);
}

std::string resolved_config(const RunConfig& config, const std::vector<LossDescription>& losses) {
  RunConfig copy = config;  // a description binds to something that it could change
  ConfigFields fields;
  describe(fields, copy, losses);
  return to_json(write_config(fields));
}

std::string run_config_schema(const std::vector<LossDescription>& losses) {
  RunConfig defaults;
  ConfigFields fields;
  describe(fields, defaults, losses);
  return to_json(config_schema(fields, "hsi4d run config"));
}

std::vector<ConfigSetting> run_config_settings(const std::vector<LossDescription>& losses) {
  RunConfig defaults;
  ConfigFields fields;
  describe(fields, defaults, losses);
  return list_settings(fields);
}

}  // namespace hsi4d
