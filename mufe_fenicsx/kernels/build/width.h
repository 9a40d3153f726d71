/* Numbers of WIDTH contacts at once: ``real`` is a double for one, a vector register for LANES of
   them; ``truth`` says of each whether. OF(name) is what a name is called there. */

#undef OF
#undef LANE
#undef real
#undef truth
#if WIDTH == 1
#define OF(name) name
#define LANE(a, i) (a)
#define real double
#define truth int
#else
#define OF(name) name##_each
#define LANE(a, i) (a)[i]
#define real vec
#define truth mask
#endif
