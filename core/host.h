// Where and when: what files note of the machine that wrote them.
#pragma once

#include <string>

namespace hsi4d {

/// Now in UTC, "2024-05-01T12:00:00Z".
std::string utc_now_text();

/// The name of this machine; "unknown" where the system does not tell.
std::string host_name();

}  // namespace hsi4d
