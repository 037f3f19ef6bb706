#include "estimator/calibrate.h"
