// What people chose in a study: the share that prefers A, and how sure that is.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pipelines/study/answers.h"

namespace hsi4d {

/// An interval of shares, 0 to 1.
struct ShareInterval {
  double low = 0, high = 1;
};

/// How often A was chosen.
struct StudyCount {
  Index answers = 0, prefer_a = 0;

  double share() const { return static_cast<double>(prefer_a) / static_cast<double>(answers); }
};

/// The share of a question.
struct StudyShare {
  std::size_t question = 0;  ///< index into kStudyQuestions
  StudyCount all;
  ShareInterval wilson;                    ///< as if every answer were another person's
  std::optional<ShareInterval> bootstrap;  ///< over persons; none of a single person
  std::optional<ShareInterval> student;    ///< over persons, by Student's t; none of a single person
  Index persons = 0;
  Index prefer_left = 0;                                    ///< answers: a habit of people, or a fault of the page
  std::vector<std::pair<std::size_t, StudyCount>> by_pair;  ///< index into the key's pairs; those with answers
};

/// How sure the intervals are.
inline constexpr double kStudyConfidence = 0.95;
/// Of fewer persons intervals over persons are rough, and the bootstrap's is too narrow.
inline constexpr Index kFewPersons = 10;
/// Resamples of the bootstrap.
inline constexpr int kStudyResamples = 10000;

/// Interval of a share from independent answers at kStudyConfidence.  [Wilson 1927, "Probable inference, the law of
/// succession, and statistical inference", J. Am. Stat. Assoc. 22]
///
///   (p + z²/2n ± z √(p (1 − p)/n + z²/4n²)) / (1 + z²/n)
///
/// Throws InternalError without answers.
ShareInterval wilson_interval(const StudyCount& count);

/// Percentiles of the share of all answers over resamples of the persons, each with all its answers: one person's
/// answers are alike, which makes fewer of them than Wilson's interval counts.  [Efron 1979; clusters: Davison and
/// Hinkley 1997, Bootstrap Methods and their Application, section 3.8]
///
/// The same for the same persons in the same order, which study_shares gives it by their ids. Throws InternalError
/// without answers.
ShareInterval person_bootstrap(const std::vector<StudyCount>& persons);

/// Interval of the share of all answers from how far persons are from it, by Student's t with m − 1 degrees of freedom
/// for m persons, cut off to [0, 1]. A person with n answers of which k are for A is k − n p away:
///
///   p ± t √(m/(m − 1) Σ (k − n p)²) / Σ n
///
/// With as many answers of everybody that is the t interval of the mean of their shares. [a
/// proportion in cluster sampling: Cochran 1977, Sampling Techniques, section 3.12; t with clusters − 1: Cameron and
/// Miller 2015, "A practitioner's guide to cluster-robust inference", J. Hum. Resour. 50, section VI.D]
///
/// Throws InternalError for fewer than two persons.
ShareInterval person_student(const std::vector<StudyCount>& persons);

/// What |t| stays below with the probability kStudyConfidence, with this many degrees of freedom, 1 or more.
/// [Abramowitz and Stegun 26.7.3 and 26.7.4]
double student_quantile(Index freedom);

/// What is to be known of the intervals of few persons, a sentence for each question.
std::vector<std::string> study_cautions(const std::vector<StudyShare>& shares);

/// A row for each question that was answered.
std::vector<StudyShare> study_shares(const StudyAnswers& answers);

/// All numbers as JSON.
std::string study_results_json(const StudyKey& key, const StudyAnswers& answers, const std::vector<StudyShare>& shares);

/// A line an answer, with a head: person,pair,question,prefers,left,seconds,plays. `prefers` and `left` are A or B.
std::string study_answers_csv(const StudyKey& key, const StudyAnswers& answers);

}  // namespace hsi4d
