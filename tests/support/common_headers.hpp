#pragma once

/// Headers that most tests read, precompiled; none of this tree (cmake/precompile.cmake). A test includes what it uses.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <span>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

// common_instances.cpp holds the code of these: a test compiles none of it.
extern template class std::vector<char>;
extern template class std::vector<unsigned char>;
extern template class std::vector<int>;
extern template class std::vector<long>;
extern template class std::vector<unsigned long>;
extern template class std::vector<float>;
extern template class std::vector<double>;
extern template class std::vector<std::string>;
