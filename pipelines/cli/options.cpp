#include "pipelines/cli/options.h"

#include <charconv>

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/config_value.h"
#include "core/text.h"

namespace hsi4d::cli {

CLI::Validator whole_number(std::int64_t most) {
  return CLI::Validator(
      [most](const std::string& text) {
        std::int64_t number = -1;
        const auto end = std::from_chars(text.data(), text.data() + text.size(), number);
        if (end.ec == std::errc() && end.ptr == text.data() + text.size() && number >= 0 && number <= most)
          return std::string();
        const bool is_open = most == std::numeric_limits<std::int64_t>::max();
        return json_string(text) + " is out of range, or not a whole number; allowed: 0 " +
               (is_open ? "or more" : "to " + std::to_string(most));
      },
      "");
}

void check_range(double value, const std::string& option, double least, double most) {
  if (value >= least && value <= most) return;
  throw UserError(option + ": " + short_number(value) + " is out of range; allowed: " + short_number(least) + " to " +
                  short_number(most));
}

void add_threads(CLI::App& command, std::optional<int>& threads) {
  command.add_option("--threads", threads, "Threads, 0: one a core; results do not depend on it")
      ->check(whole_number(1024))
      ->type_name("N");
}

void add_overrides(CLI::App& command, std::vector<std::string>& overrides) {
  add_several(command, "--set", overrides, "Change one setting: render.blur=0.1. The value is JSON, or else text")
      ->type_name("KEY=VALUE");
}

CLI::Option* add_several(CLI::App& command, const std::string& name, std::vector<std::string>& values,
                         const std::string& description) {
  return command.add_option(name, values, description)
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->allow_extra_args(false);
}

}  // namespace hsi4d::cli
