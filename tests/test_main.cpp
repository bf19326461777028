// The one file that compiles Catch2's main (about 15 s).
#define CATCH_CONFIG_MAIN
#include <catch2/catch.hpp>
