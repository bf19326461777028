// Registered loss terms by name, with settings as configs have them.
#pragma once

#include <algorithm>
#include <string>

#include "core/config_file.h"
#include "optim/loss_term.h"

namespace hsi4d::test {

inline const LossTerm& term_named(const std::string& name) {
  return *std::find_if(loss_terms().begin(), loss_terms().end(),
                       [&](const LossTerm& term) { return term.description.name == name; });
}

/// Records a term.
/// @param settings  its section in a config, JSON
template <class S>
Var<S> record_term(const std::string& name, const LossInputs<S>& inputs, const std::string& settings) {
  const LossTerm& term = term_named(name);
  LossSettings chosen = default_settings(term.description);
  ConfigFields fields;
  describe(fields, chosen);
  ConfigProblems problems;
  read_config(load_config_text(settings, "a.json", "", {}, problems), fields, problems);
  problems.throw_if_any();
  return term.record(inputs, chosen.own);
}

}  // namespace hsi4d::test
