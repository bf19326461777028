// Precompiled for all tests (tests/CMakeLists.txt). A test includes what it uses all the same.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <random>
#include <set>
#include <span>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "autodiff/tape.h"
#include "core/check.h"
#include "core/config_file.h"
#include "core/file.h"
#include "core/image.h"
#include "core/linear.h"
#include "core/parallel.h"
#include "tests/support/operator_check.h"
