// The points of a search: which settings are tried, from its seed alone.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "pipelines/sweep/file.h"

namespace hsi4d {

/// How many points each rung of successive halving has: the first one all, then of `factor` one, at least one.
///                                                         [Jamieson and Talwalkar 2016, algorithm 1]
/// @param rungs  at least 1
std::vector<std::int64_t> rung_sizes(std::int64_t points, std::size_t rungs, int factor);

/// The most points of which all rungs together are no more runs than the search may have; 0 where one point is too
/// many. At most kMostSweepRuns.
/// @param runs_per_point  of clips, seeds and whatever else each point is computed with
std::int64_t points_within(const SweepSearch& search, std::int64_t runs_per_point);

/// The number of different points of a space; nothing where it has a range of numbers that are not whole.
std::optional<std::int64_t> points_of_space(const std::vector<SweepRange>& over);

/// The value of a range at a share of it. Numbers that are not whole are as short as a thousandth of the range allows.
/// @param share  in (0, 1)
ConfigValue value_at(const SweepRange& range, double share);

/// The first `count` points of a search, as an axis: those of a larger count begin with them. Points that are the same
/// count once.
///
/// Sobol's points are those of his sequence, each dimension with a digital shift from the seed, which keeps their
/// evenness in boxes; random ones are independent and uniform, those of a key whatever other keys there are.
/// @return  nothing where that many were not found: the space has no more, or very unlikely ones
std::optional<SweepAxis> search_points(const SweepSearch& search, std::int64_t count);

}  // namespace hsi4d
