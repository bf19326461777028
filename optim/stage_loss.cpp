#include "optim/stage_loss.h"

#include "autodiff/elementwise.h"
#include "autodiff/inspect.h"
#include "core/suggest.h"
#include "core/text.h"

namespace hsi4d {

namespace {

const LossTerm& term_named(const std::string& name, std::span<const LossTerm> terms, const std::string& stage) {
  std::vector<std::string> known;
  for (const LossTerm& term : terms) {
    if (term.description.name == name) return term;
    known.push_back(term.description.name);
  }
  throw UserError(stage_message(
      stage, "there is no loss term \"" + name + "\"" + did_you_mean(name, known) + " (known: " + joined(known) + ")"));
}

/// What a term is recorded from: what was prepared of its settings, or is now.
std::any prepared_of(const LossSettings& chosen, const LossTerm& term) {
  if (chosen.prepared.has_value()) return chosen.prepared;
  return prepared_loss(term.description.prepare, chosen.own.has_value() ? chosen.own : term.description.defaults);
}

/// Notes of a term of several people: it is idle only where it is so for all, and each tells whose it is.
/// @param by_person  how many notes there were before each of them, and after the last
void name_people(const std::vector<std::size_t>& by_person, std::vector<LossNote>& notes) {
  const auto of_all = [&](bool LossNote::*flag) {
    for (std::size_t p = 0; p + 1 < by_person.size(); ++p) {
      const auto first = notes.begin() + static_cast<std::ptrdiff_t>(by_person[p]),
                 last = notes.begin() + static_cast<std::ptrdiff_t>(by_person[p + 1]);
      if (std::none_of(first, last, [flag](const LossNote& note) { return note.*flag; })) return false;
    }
    return true;
  };
  const bool is_idle = of_all(&LossNote::is_idle), is_of_clip = of_all(&LossNote::is_of_clip);
  for (std::size_t p = 0; p + 1 < by_person.size(); ++p) {
    for (std::size_t i = by_person[p]; i < by_person[p + 1]; ++i) {
      notes[i].is_idle = notes[i].is_idle && is_idle;
      notes[i].is_of_clip = notes[i].is_of_clip && is_of_clip;
      notes[i].text = "person " + std::to_string(p + 1) + ": " + notes[i].text;
    }
  }
}

/// The term of the first person and all else, and of each other person.
template <class S>
Var<S> record_term(const LossTerm& term, const LossInputs<S>& inputs, const std::any& prepared) {
  std::vector<std::size_t> notes;
  const auto count_notes = [&] {
    if (inputs.notes != nullptr) notes.push_back(inputs.notes->size());
  };
  count_notes();
  Var<S> sum = term.record(inputs, prepared);
  count_notes();
  if (!term.description.needs) return sum;  // of images
  for (LossInputs<S> other : inputs.others) {
    other.left_out = inputs.left_out;
    other.notes = inputs.notes;
    const Var<S> value = term.record(other, prepared);
    if (value.tape != nullptr) sum = sum.tape == nullptr ? value : sum + value;
    count_notes();
  }
  if (inputs.notes != nullptr && !inputs.others.empty()) name_people(notes, *inputs.notes);
  return sum;
}

}  // namespace

std::string stage_message(const std::string& stage, const std::string& text) {
  return "stage '" + stage + "': " + text;
}

UserError no_term_depends_on(const std::string& group, const std::vector<LossValue>& terms, const std::string& stage) {
  std::vector<std::string> names;
  for (const LossValue& term : terms) names.push_back(term.name);
  return UserError(
      stage_message(stage, "no loss term depends on the group \"" + group + "\" (terms: " + joined(names) + ")"));
}

template <class S>
void RecordedLoss<S>::read_values() {
  for (std::size_t k = 0; k < terms.size(); ++k)
    values[k].value = static_cast<double>(terms[k].owner().value(terms[k]).scalar());
}

template <class S>
RecordedLoss<S> record_loss(const StageSettings& settings, std::span<const LossTerm> terms, const LossInputs<S>& inputs,
                            const std::string& stage) {
  RecordedLoss<S> loss;
  LossInputs<S> asking = inputs;
  asking.left_out = &loss.left_out;
  asking.notes = &loss.notes;
  std::vector<std::string> reasons;
  for (const auto& [name, chosen] : settings.losses) {
    const LossTerm& term = term_named(name, terms, stage);
    const Var<S> value = chosen.weight == 0 ? Var<S>{} : record_term(term, asking, prepared_of(chosen, term));
    if (value.tape == nullptr) {
      loss.off.push_back(name);
      reasons.push_back(name + (chosen.weight == 0 ? " has weight 0" : " lacks an input"));
      continue;
    }
    HSI4D_CHECK(value.shape().is_scalar(), "loss term " + name + " gives more than one number");
    const Var<S> weighted = value * chosen.weight;
    loss.total = loss.terms.empty() ? weighted : loss.total + weighted;
    loss.terms.push_back(value);
    loss.values.push_back({name, chosen.weight, 0});
  }
  if (!loss.terms.empty()) return loss;
  throw UserError(stage_message(
      stage, "no loss term gives anything" + (reasons.empty() ? ": none is named" : ": " + joined(reasons))));
}

template <class S>
std::vector<OptimizerGroup<S>> named_groups(const StageSettings& settings,
                                            const std::vector<ParameterGroup<S>>& available, const std::string& stage) {
  std::vector<OptimizerGroup<S>> groups;
  for (const auto& [name, group_settings] : settings.optimize) {
    for (const ParameterGroup<S>& group : available) {
      if (group.name == name) groups.push_back({group, group_settings});
    }
  }
  for (auto a = groups.begin(); a != groups.end(); ++a) {
    for (auto b = groups.begin(); b != a; ++b) {
      for (const Var<S> x : a->parameters.blocks) {
        for (const Var<S> y : b->parameters.blocks) {
          if (x.id != y.id) continue;
          throw UserError(stage_message(
              stage, "groups \"" + b->parameters.name + "\" and \"" + a->parameters.name + "\" share the parameter '" +
                         TapeInspector<S>(x.owner()).array_name(x.id) + "'; only one of them can be optimised"));
        }
      }
    }
  }
  return groups;
}

template <class S>
void set_frozen(Tape<S>& tape, const ParameterGroup<S>& group, bool frozen) {
  for (const Var<S> block : group.blocks) frozen ? tape.freeze(block) : tape.unfreeze(block);
}

template <class S>
TapeGuard<S>::TapeGuard(Tape<S>& tape, const std::vector<ParameterGroup<S>>& available)
    : tape_(tape), available_(available), mark_(tape.mark()) {
  for (const ParameterGroup<S>& group : available) {
    for (const Var<S> block : group.blocks) frozen_.push_back(tape.frozen(block));
  }
}

template <class S>
void TapeGuard<S>::restore() const {
  tape_.set_profiling(false);
  tape_.rewind(mark_);
  auto was_frozen = frozen_.begin();
  for (const ParameterGroup<S>& group : available_) {
    for (const Var<S> block : group.blocks) *was_frozen++ ? tape_.freeze(block) : tape_.unfreeze(block);
  }
}

template struct RecordedLoss<float>;
template struct RecordedLoss<double>;
template RecordedLoss<float> record_loss(const StageSettings&, std::span<const LossTerm>, const LossInputs<float>&,
                                         const std::string&);
template RecordedLoss<double> record_loss(const StageSettings&, std::span<const LossTerm>, const LossInputs<double>&,
                                          const std::string&);
template std::vector<OptimizerGroup<float>> named_groups(const StageSettings&,
                                                         const std::vector<ParameterGroup<float>>&, const std::string&);
template std::vector<OptimizerGroup<double>> named_groups(const StageSettings&,
                                                          const std::vector<ParameterGroup<double>>&,
                                                          const std::string&);
template void set_frozen(Tape<float>&, const ParameterGroup<float>&, bool);
template void set_frozen(Tape<double>&, const ParameterGroup<double>&, bool);
template class TapeGuard<float>;
template class TapeGuard<double>;

}  // namespace hsi4d
