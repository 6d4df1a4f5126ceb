/* Frames and parameters of EoE, equal in SOEM 1.4 and 2.0. The headers of both versions include this file where their own sizes are known. */
#ifndef MARGAY_SOEM_EOE_H
#define MARGAY_SOEM_EOE_H

#define EOE_DNS_NAME_LENGTH 32
#define EOE_ETHADDR_LENGTH 6
#define EOE_PARAM_OFFSET 4
#define EOE_PARAM_MAC_INCLUDE (0x1 << 0)
#define EOE_PARAM_IP_INCLUDE (0x1 << 1)
#define EOE_PARAM_SUBNET_IP_INCLUDE (0x1 << 2)
#define EOE_PARAM_DEFAULT_GATEWAY_INCLUDE (0x1 << 3)
#define EOE_PARAM_DNS_IP_INCLUDE (0x1 << 4)
#define EOE_PARAM_DNS_NAME_INCLUDE (0x1 << 5)
#define EOE_FRAG_DATA 0
#define EOE_INIT_RESP_TIMESTAMP 1
#define EOE_INIT_REQ 2
#define EOE_INIT_RESP 3
#define EOE_SET_ADDR_FILTER_REQ 4
#define EOE_SET_ADDR_FILTER_RESP 5
#define EOE_GET_IP_PARAM_REQ 6
#define EOE_GET_IP_PARAM_RESP 7
#define EOE_GET_ADDR_FILTER_REQ 8
#define EOE_GET_ADDR_FILTER_RESP 9
#define EOE_RESULT_SUCCESS 0x0000
#define EOE_RESULT_UNSPECIFIED_ERROR 0x0001
#define EOE_RESULT_UNSUPPORTED_FRAME_TYPE 0x0002
#define EOE_RESULT_NO_IP_SUPPORT 0x0201
#define EOE_RESULT_NO_DHCP_SUPPORT 0x0202
#define EOE_RESULT_NO_FILTER_SUPPORT 0x0401

/* Addresses */
#define EOE_MAKEU32(a, b, c, d) \
    (((uint32_t)((a) & 0xff) << 24) | ((uint32_t)((b) & 0xff) << 16) | ((uint32_t)((c) & 0xff) << 8) | \
     (uint32_t)((d) & 0xff))
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
#define EOE_HTONS(x) ((uint16_t)(x))
#define EOE_HTONL(x) ((uint32_t)(x))
#else
#define EOE_HTONS(x) ((uint16_t)((((uint16_t)(x) & 0x00ffU) << 8) | (((uint16_t)(x) & 0xff00U) >> 8)))
#define EOE_HTONL(x) \
    ((((uint32_t)(x) & 0x000000ffUL) << 24) | (((uint32_t)(x) & 0x0000ff00UL) << 8) | \
     (((uint32_t)(x) & 0x00ff0000UL) >> 8) | (((uint32_t)(x) & 0xff000000UL) >> 24))
#endif
#define EOE_NTOHS(x) EOE_HTONS(x)
#define EOE_NTOHL(x) EOE_HTONL(x)
#define eoe_ip4_addr1(p) (((const uint8_t *)(&(p)->addr))[0])
#define eoe_ip4_addr2(p) (((const uint8_t *)(&(p)->addr))[1])
#define eoe_ip4_addr3(p) (((const uint8_t *)(&(p)->addr))[2])
#define eoe_ip4_addr4(p) (((const uint8_t *)(&(p)->addr))[3])
#define EOE_IP4_ADDR_TO_U32(p, a, b, c, d) ((p)->addr = EOE_HTONL(EOE_MAKEU32(a, b, c, d)))

/* Fields of the two information words of the EoE header */
#define EOE_HDR_FRAME_TYPE_OFFSET 0
#define EOE_HDR_FRAME_TYPE (0xf << 0)
#define EOE_HDR_FRAME_TYPE_SET(x) (((x) & 0xf) << 0)
#define EOE_HDR_FRAME_TYPE_GET(x) (((x) >> 0) & 0xf)
#define EOE_HDR_FRAME_PORT_OFFSET 4
#define EOE_HDR_FRAME_PORT (0xf << 4)
#define EOE_HDR_FRAME_PORT_SET(x) (((x) & 0xf) << 4)
#define EOE_HDR_FRAME_PORT_GET(x) (((x) >> 4) & 0xf)
#define EOE_HDR_LAST_FRAGMENT_OFFSET 8
#define EOE_HDR_LAST_FRAGMENT (0x1 << 8)
#define EOE_HDR_LAST_FRAGMENT_SET(x) (((x) & 0x1) << 8)
#define EOE_HDR_LAST_FRAGMENT_GET(x) (((x) >> 8) & 0x1)
#define EOE_HDR_TIME_APPEND_OFFSET 9
#define EOE_HDR_TIME_APPEND (0x1 << 9)
#define EOE_HDR_TIME_APPEND_SET(x) (((x) & 0x1) << 9)
#define EOE_HDR_TIME_APPEND_GET(x) (((x) >> 9) & 0x1)
#define EOE_HDR_TIME_REQUEST_OFFSET 10
#define EOE_HDR_TIME_REQUEST (0x1 << 10)
#define EOE_HDR_TIME_REQUEST_SET(x) (((x) & 0x1) << 10)
#define EOE_HDR_TIME_REQUEST_GET(x) (((x) >> 10) & 0x1)
#define EOE_HDR_FRAG_NO_OFFSET 0
#define EOE_HDR_FRAG_NO (0x3f << 0)
#define EOE_HDR_FRAG_NO_SET(x) (((x) & 0x3f) << 0)
#define EOE_HDR_FRAG_NO_GET(x) (((x) >> 0) & 0x3f)
#define EOE_HDR_FRAME_OFFSET_OFFSET 6
#define EOE_HDR_FRAME_OFFSET (0x3f << 6)
#define EOE_HDR_FRAME_OFFSET_SET(x) (((x) & 0x3f) << 6)
#define EOE_HDR_FRAME_OFFSET_GET(x) (((x) >> 6) & 0x3f)
#define EOE_HDR_FRAME_NO_OFFSET 12
#define EOE_HDR_FRAME_NO (0xf << 12)
#define EOE_HDR_FRAME_NO_SET(x) (((x) & 0xf) << 12)
#define EOE_HDR_FRAME_NO_GET(x) (((x) >> 12) & 0xf)

/* IPv4 address in network order */
typedef struct {
    uint32_t addr;
} eoe_ip4_addr_t;

/* MAC address */
typedef struct MARGAY_SOEM_PACKED {
    uint8_t addr[EOE_ETHADDR_LENGTH];
} eoe_ethaddr_t;

/* Parameters of an IP stack; a bit for each parameter that is set */
typedef struct {
    __extension__ uint8_t mac_set : 1;
    __extension__ uint8_t ip_set : 1;
    __extension__ uint8_t subnet_set : 1;
    __extension__ uint8_t default_gateway_set : 1;
    __extension__ uint8_t dns_ip_set : 1;
    __extension__ uint8_t dns_name_set : 1;
    eoe_ethaddr_t mac;
    eoe_ip4_addr_t ip;
    eoe_ip4_addr_t subnet;
    eoe_ip4_addr_t default_gateway;
    eoe_ip4_addr_t dns_ip;
    char dns_name[EOE_DNS_NAME_LENGTH];
} eoe_param_t;

/* An EoE message: a fragment, or a service with a result */
typedef struct MARGAY_SOEM_PACKED {
    ec_mbxheadert mbxheader;
    uint16_t frameinfo1;
    __extension__ union {
        uint16_t frameinfo2;
        uint16_t result;
    };
    uint8 data[EC_MAXMBX - 10];
} ec_EOEt;

#endif
