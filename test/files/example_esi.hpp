// An ESI of a device that was made up for these tests.
#pragma once

namespace margay::files {

inline constexpr const char* kExampleEsi = R"(<?xml version="1.0" encoding="UTF-8"?>
<EtherCATInfo Version="1.6">
  <Vendor><Id>#xF00</Id><Name LcId="1033">Example works</Name></Vendor>
  <Descriptions>
    <Groups><Group><Type>Drv</Type><Name LcId="1031">Antriebe</Name><Name LcId="1033">Drives</Name></Group></Groups>
    <Devices>
    <Device Physics="Y K ">
      <Type ProductCode="#x1234" RevisionNo="#x00020001" CheckRevisionNo="EQ_OR_G">EX100</Type>
      <Name LcId="1031">Antrieb</Name>
      <Name LcId="1033">Drive 100 µm</Name>
      <Info><Electrical><EBusCurrent>070</EBusCurrent></Electrical>
        <StateMachine><Timeout><PreopTimeout>3000</PreopTimeout><SafeopOpTimeout>9000</SafeopOpTimeout></Timeout></StateMachine>
        <Mailbox><Timeout><ResponseTimeout>2000</ResponseTimeout></Timeout></Mailbox>
      </Info>
      <GroupType>Drv</GroupType>
      <Profile><ProfileNo>402</ProfileNo>
        <Dictionary>
          <DataTypes>
            <DataType><Name>UINT</Name><BitSize>16</BitSize></DataType>
            <DataType><Name>DT2000ARR</Name><BaseType>UINT</BaseType><BitSize>32</BitSize><ArrayInfo><LBound>1</LBound><Elements>2</Elements></ArrayInfo></DataType>
            <DataType><Name>DT2000</Name><BitSize>48</BitSize>
              <SubItem><SubIdx>0</SubIdx><Name>SubIndex 000</Name><Type>USINT</Type><BitSize>8</BitSize><BitOffs>0</BitOffs><Flags><Access>ro</Access></Flags></SubItem>
              <SubItem><Name>Elements</Name><Type>DT2000ARR</Type><BitSize>32</BitSize><BitOffs>16</BitOffs><Flags><Access>rw</Access></Flags></SubItem>
            </DataType>
          </DataTypes>
          <Objects>
            <Object><Index>#x1000</Index><Name>Device type</Name><Type>UDINT</Type><BitSize>32</BitSize><Info><DefaultData>92010200</DefaultData></Info><Flags><Access>ro</Access></Flags></Object>
            <Object><Index>#x2000</Index><Name>Gains</Name><Type>DT2000</Type><BitSize>48</BitSize>
              <Info><SubItem><Name>SubIndex 000</Name></SubItem><SubItem><Name>Gain P</Name></SubItem><SubItem><Name>Gain I</Name></SubItem></Info>
              <Flags><Access>rw</Access></Flags></Object>
          </Objects>
        </Dictionary>
      </Profile>
      <Fmmu>Outputs</Fmmu><Fmmu>Inputs</Fmmu><Fmmu>MBoxState</Fmmu>
      <Sm StartAddress="#x1000" DefaultSize="128" ControlByte="#x26" Enable="1">MBoxOut</Sm>
      <Sm StartAddress="#x1080" DefaultSize="128" ControlByte="#x22" Enable="1">MBoxIn</Sm>
      <Sm StartAddress="#x1100" ControlByte="#x64" Enable="1">Outputs</Sm>
      <Sm StartAddress="#x1180" ControlByte="#x20" Enable="1">Inputs</Sm>
      <RxPdo Fixed="1" Sm="2">     <Index>#x1600</Index>
        <Name>Outputs</Name>
        <Entry><Index>#x6040</Index><SubIndex>0</SubIndex>
            <BitLen>16</BitLen><Name>Control word</Name><DataType>UINT</DataType></Entry>
        <Entry><Index>0</Index><BitLen>8</BitLen></Entry>
        <Entry><Index>#x607A</Index><BitLen>32</BitLen><Name>Target position</Name><DataType>DINT</DataType></Entry>
      </RxPdo>
      <RxPdo>
        <Index>#x1601</Index>
        <Name>Other outputs</Name>
        <Exclude>#x1600</Exclude>
        <Entry><Index>#x60FF</Index><SubIndex>0</SubIndex><BitLen>32</BitLen><Name>Target velocity</Name><DataType>DINT</DataType></Entry>
      </RxPdo>
      <TxPdo Mandatory="true" Sm="3">
        <Index>#x1A00</Index>
        <Name>Inputs</Name>
        <Entry>
          <Index>#x6041</Index><SubIndex>0</SubIndex><BitLen>16</BitLen>
          <Name>Status word</Name><DataType>UINT</DataType>
        </Entry>
      </TxPdo>
      <Mailbox DataLinkLayer="1">
          <CoE SdoInfo="1" PdoAssign="1" PdoConfig="0" CompleteAccess="true">
            <InitCmd><Transition>PS</Transition><Transition>SO</Transition><Index>#x2001</Index><SubIndex>0</SubIndex> <Data>E903</Data></InitCmd>
          </CoE>
        <FoE/>
      </Mailbox>
      <Dc>
        <OpMode><Name>Free run</Name><Desc>No SYNC</Desc><AssignActivate>0</AssignActivate></OpMode>
        <OpMode><Name>DC</Name><AssignActivate>#x0300</AssignActivate>
          <CycleTimeSync0 Factor="-2">0</CycleTimeSync0><ShiftTimeSync0>-3</ShiftTimeSync0></OpMode>
      </Dc>
      <ESC><Reg0400>2498</Reg0400><Reg0420>1000</Reg0420></ESC>
      <Eeprom>
        <ByteSize>2048</ByteSize>
        <ConfigData>050E03000A0000000000</ConfigData>
        <BootStrap>0010800080108000</BootStrap>
        <Category><CatNo>1</CatNo><Data>AABB</Data></Category>
      </Eeprom>
    </Device>
    </Devices>
  </Descriptions>
</EtherCATInfo>
)";

// A coupler with slots and two modules.
inline constexpr const char* kModularEsi = R"(<?xml version="1.0"?>
<EtherCATInfo>
  <Vendor><Id>#xF00</Id><Name>Example works</Name></Vendor>
  <Descriptions>
    <Devices><Device Physics="YY">
      <Type ProductCode="#x77" RevisionNo="1">Station</Type><Name>Station</Name>
      <Sm StartAddress="#x1000" DefaultSize="128" ControlByte="#x26" Enable="1">MBoxOut</Sm>
      <Sm StartAddress="#x1080" DefaultSize="128" ControlByte="#x22" Enable="1">MBoxIn</Sm>
      <Sm StartAddress="#x1100" ControlByte="#x64" Enable="1">Outputs</Sm>
      <Sm StartAddress="#x1180" ControlByte="#x20" Enable="1">Inputs</Sm>
      <Mailbox><CoE PdoAssign="1"/></Mailbox>
      <Slots MaxSlotCount="3" SlotPdoIncrement="1" SlotIndexIncrement="#x10" DownloadModuleIdentList="1">
        <Slot MinInstances="0" MaxInstances="4"><Name>Slot</Name><ModuleIdent Default="1">#x22</ModuleIdent><ModuleIdent>#x11</ModuleIdent></Slot>
      </Slots>
    </Device></Devices>
    <Modules>
      <Module><Type ModuleIdent="#x11">DI8</Type><Name>Inputs</Name>
        <TxPdo Sm="3"><Index DependOnSlot="1">#x1A00</Index><Name>In</Name>
          <Entry><Index DependOnSlot="1">#x6000</Index><SubIndex>1</SubIndex><BitLen>8</BitLen><Name>Bits</Name><DataType>USINT</DataType></Entry></TxPdo>
        <Mailbox><CoE><InitCmd><Transition>PS</Transition><Index DependOnSlot="1">#x8000</Index><SubIndex>1</SubIndex><Data>05</Data></InitCmd></CoE></Mailbox>
      </Module>
      <Module><Type ModuleIdent="#x22">DO8</Type><Name>Outputs</Name>
        <RxPdo><Index DependOnSlot="1">#x1600</Index><Name>Out</Name>
          <Entry><Index DependOnSlot="1">#x7000</Index><SubIndex>1</SubIndex><BitLen>8</BitLen><Name>Bits</Name><DataType>USINT</DataType></Entry></RxPdo>
      </Module>
    </Modules>
  </Descriptions>
</EtherCATInfo>
)";

}  // namespace margay::files
