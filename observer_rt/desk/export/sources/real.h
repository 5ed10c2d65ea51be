/* Numbers: double, or float where parameters.h says so. */
#ifndef REAL_H
#define REAL_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#if OBSERVER_SINGLE
typedef float real_t;
#define R(number) number##f
#define r_fabs fabsf
#define r_sqrt sqrtf
#define r_exp expf
#define r_expm1 expm1f
#define r_log logf
#define r_pow powf
#define r_sin sinf
#define r_cos cosf
#define r_tanh tanhf
#define r_ceil ceilf
#define r_copysign copysignf
#else
typedef double real_t;
#define R(number) number
#define r_fabs fabs
#define r_sqrt sqrt
#define r_exp exp
#define r_expm1 expm1
#define r_log log
#define r_pow pow
#define r_sin sin
#define r_cos cos
#define r_tanh tanh
#define r_ceil ceil
#define r_copysign copysign
#endif

#define REAL_PI R(3.14159265358979323846)

static inline real_t r_min(real_t a, real_t b) { return (b < a) ? b : a; }
static inline real_t r_max(real_t a, real_t b) { return (b > a) ? b : a; }

#endif
