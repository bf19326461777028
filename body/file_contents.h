// What an archive of a body holds, by the names of its arrays: for messages about one that is given in place of
// another.
#pragma once

#include <string>

#include "core/npz.h"

namespace hsi4d {

/// "a body model", "a motion", "parameters of smplx", "an avatar", "poses of objects", …; empty where the names say
/// nothing known. A motion may be by the names of smplx too: what has only those is "parameters of smplx".
std::string contents_of(const Npz& file);

/// Throws DataError, "FILE: holds a motion, not a body model", where the contents are known and none of `wanted`, whose
/// first is named, and `hint` after it.
void refuse_other_contents(const Npz& file, std::initializer_list<const char*> wanted, const std::string& hint = "");

}  // namespace hsi4d
