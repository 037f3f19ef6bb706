// main() of the tests that calibrate: with the kernels of linear algebra that the programs take.
#include <gmock/gmock.h>

#include "estimator/linear_algebra.h"

int main(int argc, char** argv) {
  plumbline::start_with_kernels_for_processor(argv);
  testing::InitGoogleMock(&argc, argv);
  return RUN_ALL_TESTS();
}
