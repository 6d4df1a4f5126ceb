/* A library that other programs load while they run, as the extension modules of Python and the plugins of ROS do. */
#ifdef SOEM2
#include <soem/soem.h>
#else
#include <ethercat.h>
#endif

int plugin_start(const char* source);

int plugin_start(const char* source) {
    static char map[4096];
    int slaves;
#ifdef SOEM2
    static ecx_contextt context;
    if (!ecx_init(&context, source)) return -1;
    slaves = ecx_config_init(&context);
    ecx_config_map_group(&context, map, 0);
    ecx_close(&context);
#else
    if (!ec_init(source)) return -1;
    slaves = ec_config_init(FALSE);
    ec_config_map(map);
    ec_close();
#endif
    return slaves;
}
