// `hsi4d schema [KIND]`: the JSON Schema of configs.
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/suggest.h"
#include "core/text.h"
#include "pipelines/avatar/fit.h"
#include "pipelines/cli/list.h"
#include "pipelines/config/run_config.h"
#include "pipelines/scan/settings.h"
#include "pipelines/sweep/file.h"

namespace hsi4d::cli {
namespace {

/// Of `hsi4d run`, `hsi4d avatar fit`, `hsi4d reconstruct` and `hsi4d sweep`.
std::vector<std::string> schema_kinds() { return {"run", "avatar_fit", "reconstruct", "sweep"}; }

/// Throws UserError for another kind.
std::string schema_command(const std::string& kind, const std::vector<LossDescription>& losses) {
  if (kind == "run") return run_config_schema(losses);
  if (kind == "avatar_fit") return avatar_fit_schema(losses);
  if (kind == "reconstruct") return scan_schema(losses);
  if (kind == "sweep") return sweep_schema();
  throw UserError("hsi4d schema: there are no configs of \"" + kind + "\"; known: " + joined(schema_kinds()) +
                  did_you_mean(kind, schema_kinds()));
}

}  // namespace

void add_schema(CLI::App& app, Program& program) {
  auto& kind = program.options<std::string>();
  kind = "run";
  CLI::App* schema = app.add_subcommand("schema", "Print the JSON Schema of configs, for editors");
  schema->add_option("KIND", kind, "Of which configs: " + joined(schema_kinds()) + "; default: run");
  run_when_chosen(*schema, program, [&] { return schema_command(kind, descriptions_of(program.terms)); });
}

}  // namespace hsi4d::cli
